"""What the benchmarks' own evaluations say of a file of detections; runs where they are installed, without scenicq.

`python benchmark_figures.py nuscenes DATAROOT VERSION SPLIT DETECTIONS` with nuscenes-devkit,
`python benchmark_figures.py argoverse2 FOLDER LABELS DETECTIONS [all]` with av2; `all` leaves out no box for where it
lies. Prints one JSON object: for each class its average precisions by centre distance, and its errors; of nuScenes the
totals, too. Those of av2 are rounded, and over classes of its own choice here.
"""

from __future__ import annotations

import json
import sys
import tempfile


def of_nuscenes(root: str, version: str, split: str, detections: str) -> dict[str, dict[str, float]]:
    from nuscenes.eval.common.config import config_factory
    from nuscenes.eval.detection.evaluate import DetectionEval
    from nuscenes.nuscenes import NuScenes

    names = {"trans_err": "translation", "scale_err": "scale", "orient_err": "orientation", "vel_err": "velocity",
             "attr_err": "attribute"}  # fmt: skip
    with tempfile.TemporaryDirectory() as work:
        labels = NuScenes(version=version, dataroot=root, verbose=False)
        given = DetectionEval(labels, config_factory("detection_cvpr_2019"), detections, split, work, verbose=False)
        told = given.evaluate()[0].serialize()
    found = {
        name: {f"{distance:g}": value for distance, value in precisions.items()}
        | {names[error]: value for error, value in told["label_tp_errors"][name].items()}
        for name, precisions in told["label_aps"].items()
    }
    totals = {names[error]: value for error, value in told["tp_errors"].items()}
    return {**found, "all classes": {"NDS": told["nd_score"], "mAP": told["mean_ap"], **totals}}


def of_argoverse2(folder: str, labels: str, detections: str, *, everywhere: bool) -> dict[str, dict[str, float]]:
    from pathlib import Path

    import numpy as np
    import pandas as pd
    from av2.evaluation.detection.eval import evaluate
    from av2.evaluation.detection.utils import DetectionCfg, compute_average_precision

    classes = tuple(sorted(pd.read_feather(labels)["category"].unique()))
    given = DetectionCfg(categories=classes, dataset_dir=Path(folder), eval_only_roi_instances=not everywhere)
    boxes, objects, _ = evaluate(pd.read_feather(detections), pd.read_feather(labels), given, n_jobs=1)
    found: dict[str, dict[str, float]] = {}
    for name in classes:
        count = int(objects.loc[objects["category"] == name, "is_evaluated"].sum())
        mine = boxes.loc[(boxes["category"] == name) & boxes["is_evaluated"].astype(bool)]
        mine = mine.sort_values(by="score", ascending=False, kind="stable")
        if count:
            found[name] = {}
            for distance in given.affinity_thresholds_m:
                hits = mine[distance].astype(bool).to_numpy()
                value = compute_average_precision(hits, np.linspace(0, 1, given.num_recall_samples), count)[0]
                found[name][f"{distance:g}"] = float(value) if len(hits) else 0.0
            right = mine.loc[mine[2.0].astype(bool)]
            if len(right):
                columns = {"ATE": "translation", "ASE": "scale", "AOE": "orientation"}
                found[name] |= {told: float(right[name].mean()) for name, told in columns.items()}
    return found


if __name__ == "__main__":
    which, *rest = sys.argv[1:]
    figures = of_nuscenes(*rest) if which == "nuscenes" else of_argoverse2(*rest[:3], everywhere="all" in rest[3:])
    print("FIGURES " + json.dumps(figures))
