"""What a query does before it finds anything: no more than it needs."""

from scenicq.errors import Source
from scenicq.query.execution.run import Query
from scenicq.store import dataset as store
from scenicq.store.dataset import open_dataset

PLAIN = "model scenic.domains.driving.model\nego = new Car\nnew Car ahead of ego by Range(0, 50)\n"
CHOSEN = "model scenic.domains.driving.model\nego = new Car on Uniform(*network.lanes)\n"


def test_frames_are_found_over_one_connection(crossroads, monkeypatch):
    opened, connect = [], store.connect_in_memory
    monkeypatch.setattr(store, "connect_in_memory", lambda config: opened.append(connect(config)) or opened[-1])
    assert list(Query(open_dataset(crossroads), Source("plain.scenic", PLAIN)).results())
    assert len(opened) == 1


def test_elements_of_a_map_are_linked_for_programs_that_name_them(crossroads):
    linked = []
    for text in (PLAIN, CHOSEN):
        query = Query(open_dataset(crossroads), Source("start.scenic", text))
        list(query.plans())
        linked.append(["_linked" in vars(query.compiled_map(name).network) for name in query.dataset.maps])
    assert linked == [[False], [True]]
