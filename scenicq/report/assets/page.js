"use strict";
(() => {
  const runs = [...document.querySelectorAll(".run")];
  const list = document.getElementById("runs");
  const filter = document.getElementById("filter");
  const sort = document.getElementById("sort");
  const kind = document.getElementById("kind");
  const shown = document.getElementById("shown");

  // --- one run: its slider, its picture, its facts

  const steps = new WeakMap();
  const shows = new WeakMap();
  for (const run of runs) {
    const slider = run.querySelector("input[type=range]");
    if (!slider) continue;
    const output = run.querySelector("output");
    const picture = run.querySelector(".picture");
    const shots = [...run.querySelectorAll(".shot")];
    const now = [...run.querySelectorAll(".timeline .now")];
    const facts = [...run.querySelectorAll(".frame")];
    const show = (number) => {
      const at = Math.min(shots.length, Math.max(1, number)) - 1;
      const shot = shots[at];
      slider.value = at + 1;
      slider.setAttribute("aria-valuetext", `frame ${at + 1} of ${shots.length}`);
      output.textContent = `${at + 1} / ${shots.length}`;
      for (const line of now) {
        line.setAttribute("x1", at + 0.5);
        line.setAttribute("x2", at + 0.5);
      }
      facts.forEach((each, index) => { each.hidden = index !== at; });
      if (shot.dataset.picture) {
        picture.src = shot.dataset.picture;
        picture.alt = shot.dataset.told;
      } else {
        // elements of SVG have the attribute, but not the property
        shots.forEach((each, index) => { each.toggleAttribute("hidden", index !== at); });
        picture.setAttribute("viewBox", shot.dataset.view);
        picture.setAttribute("aria-label", shot.dataset.told);
      }
    };
    shows.set(run, show);
    const step = (by) => show(Number(slider.value) + by);
    slider.addEventListener("input", () => show(Number(slider.value)));
    run.querySelector(".back").addEventListener("click", () => step(-1));
    run.querySelector(".on").addEventListener("click", () => step(1));
    // browsers keep the position of a slider over a reload
    show(1);
    steps.set(run, step);
  }

  // --- small pictures lead to the frame that they show

  for (const tile of document.querySelectorAll(".tile")) {
    const run = document.getElementById(tile.dataset.run);
    tile.addEventListener("click", () => shows.get(run)?.(Number(tile.dataset.frame)));
  }

  // --- all runs: filter and sort

  const visible = () => [...document.querySelectorAll(".run:not([hidden])")];
  const narrow = () => {
    const wanted = filter.value.trim().toLowerCase();
    for (const run of runs) {
      run.hidden = !run.dataset.recording.toLowerCase().includes(wanted)
        || (kind !== null && kind.value !== "" && kind.value !== run.dataset.kind);
    }
    const left = visible();
    const frames = left.reduce((sum, run) => sum + Number(run.dataset.length), 0);
    shown.textContent = `${frames} ${frames === 1 ? "frame" : "frames"} in ${left.length} ${list.dataset.what}${left.length === 1 ? "" : "s"}`;
  };
  const arrange = () => {
    const down = sort.value.startsWith("-");
    const key = sort.value.replace(/^-?data-/, "");
    const order = (run) => Number(run.dataset[key]) * (down ? -1 : 1);
    runs.sort((a, b) => order(a) - order(b) || Number(a.dataset.order) - Number(b.dataset.order));
    list.append(...runs);
  };
  if (filter) {
    filter.addEventListener("input", narrow);
    sort.addEventListener("change", arrange);
    kind?.addEventListener("change", narrow);
    arrange();
    narrow();
  }

  // --- keys

  const go = (by) => {
    const left = visible();
    const now = left.indexOf(document.activeElement.closest(".run"));
    const next = left[now < 0 ? 0 : Math.min(left.length - 1, Math.max(0, now + by))];
    if (next) {
      next.focus({ preventScroll: true });
      next.scrollIntoView({ block: "start" });
    }
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target.matches("input, select, textarea");
    if (event.key === "Escape" && event.target === filter) {
      filter.value = "";
      narrow();
      filter.blur();
    }
    if (typing) return;
    const run = event.target.closest(".run");
    const step = run && steps.get(run);
    if (event.key === "j") go(1);
    else if (event.key === "k") go(-1);
    else if (event.key === "/" && filter) { event.preventDefault(); filter.focus(); }
    else if (event.key === "ArrowRight" && step) { event.preventDefault(); step(1); }
    else if (event.key === "ArrowLeft" && step) { event.preventDefault(); step(-1); }
  });

  // --- the command line

  const copy = document.getElementById("copy");
  if (copy) {
    const command = document.getElementById("command");
    const copied = document.getElementById("copied");
    const select = () => {
      const range = document.createRange();
      range.selectNodeContents(command);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      return document.execCommand("copy");
    };
    // a clipboard that somebody else holds may never answer
    const late = () => new Promise((_, refuse) => setTimeout(refuse, 1000));
    copy.addEventListener("click", async () => {
      let done = false;
      try {
        await Promise.race([navigator.clipboard.writeText(command.textContent), late()]);
        done = true;
      } catch {
        done = select();
      }
      copied.textContent = done ? "Copied" : "Selected: copy it with the keyboard";
    });
  }
})();
