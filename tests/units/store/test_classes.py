"""The class tree and the taxonomies."""

from __future__ import annotations

import pytest

from scenicq.store.classes import (
    ROOT,
    ancestors,
    fold,
    is_class,
    is_subclass,
    subclasses,
    taxonomy,
    taxonomy_names,
)


def test_tree_has_one_root_and_no_dangling_parent() -> None:
    every = subclasses(ROOT)
    assert ancestors("Ambulance") == ("Ambulance", "EmergencyVehicle", "Vehicle", "Object")
    assert all(ancestors(category)[-1] == ROOT for category in every)
    assert len(every) == len(set(every)) > 20


@pytest.mark.parametrize(
    ("category", "of", "expected"),
    [
        ("Car", "Vehicle", True),
        ("Car", "Car", True),
        ("Vehicle", "Car", False),
        ("Child", "Pedestrian", True),
        ("Trash", "Debris", True),
        ("Cone", "Vehicle", False),
    ],
)
def test_subclass(category: str, of: str, expected: bool) -> None:
    assert is_subclass(category, of) is expected
    assert (category in subclasses(of)) is expected


def test_coarse_folds_all_wheels_and_all_people_and_nothing_else() -> None:
    wheels = {"Car", "Truck", "Bus", "Bicycle", "Motorcycle", "Trailer", "ConstructionVehicle", "PoliceCar", "Vehicle"}
    assert {fold(category, "coarse") for category in wheels} == {"Car"}
    assert {fold(category, "coarse") for category in subclasses("Pedestrian")} == {"Pedestrian"}
    assert [fold(category, "coarse") for category in ("Cone", "Animal", "Object")] == ["Cone", "Animal", "Object"]


def test_fine_folds_nothing() -> None:
    assert all(fold(category, "fine") == category for category in subclasses(ROOT))


def test_unknown_class_is_an_error_of_the_caller() -> None:
    for call in (ancestors, subclasses, lambda name: fold(name, "fine")):
        with pytest.raises(KeyError):
            call("Spaceship")
    assert not is_class("Spaceship")


def test_taxonomies_end_in_the_tree() -> None:
    for name in taxonomy_names():
        assert all(is_class(category) for category in taxonomy(name).values())
    # The 23 categories of the dataset, and the name that its lidar labels use for the ego.
    assert len(taxonomy("nuscenes")) == 24
    assert taxonomy("nuscenes")["vehicle.bus.bendy"] == "Bus"
    assert taxonomy("scenic")["Truck"] == "Truck"
    with pytest.raises(KeyError):
        taxonomy("klingon")
