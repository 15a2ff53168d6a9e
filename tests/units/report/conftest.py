"""What the tests of pictures and reports share."""

import pytest

from scenicq.match.matcher import Matcher
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.frame_explanation import explain
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import Shot
from scenicq.store.dataset import open_dataset


@pytest.fixture(scope="session")
def shoot(crossroads, scenarios):
    """Match one frame of the sample data with one of the sample scenarios; the shot and its map."""
    dataset = open_dataset(crossroads)
    worlds = {}

    def make(frame, scenario=None, *, why=False):
        (label,) = dataset.labels([frame])
        if scenario not in worlds:
            if scenario is None:
                worlds[scenario] = None, Backdrop(dataset.network("crossroads"))
            else:
                query = Query(dataset, read_program(scenarios / scenario), QueryOptions())
                compiled, network = query.compile("crossroads")
                worlds[scenario] = Matcher(compiled, query.options.match), Backdrop(network)
        matcher, backdrop = worlds[scenario]
        if matcher is None:
            return Shot(label), backdrop
        verdict = matcher.match(label)
        return Shot(label, matcher.scenario, verdict, explain(matcher, label) if why else None), backdrop

    return make
