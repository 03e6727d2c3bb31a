"""Names of foreign variants: read from text, refused by name, and told by the twin's options."""

from __future__ import annotations

import pytest

from dsl_core.errors import DeviceError
from dsl_core.simulation.foreign.variants import VARIANTS, Foreign
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.simulation.twin_options import TwinOptions


def test_names_are_read_and_all_is_all_but_those_that_stand_alone() -> None:
    assert Foreign.of("") is None
    assert Foreign.of(" ") is None
    assert Foreign.of("blur, prnu", 3) == Foreign(frozenset({"blur", "prnu"}), 3)
    assert Foreign.of("all") == Foreign(frozenset(VARIANTS) - {"tone-s", "tone-srgb", "red-edge"})


def test_an_unknown_name_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(DeviceError, match=r"no foreign variant 'glow'\. Choose all, or some of plain, blur"):
        open_twin({"foreign": "blur,glow"})


@pytest.mark.parametrize("effects", ["auto", "all", "halo,depth-of-field"])
def test_effects_that_foreign_light_does_not_have_are_refused(effects: str) -> None:
    with pytest.raises(DeviceError, match="rendered without depth of field"):
        TwinOptions.of({"foreign": "blur", "effects": effects})
    assert TwinOptions.of({"foreign": "blur", "effects": "halo,glare"})[0].foreigners is not None


def test_the_option_names_every_variant() -> None:
    description = TwinOptions.model_fields["foreign"].description
    assert description is not None
    assert all(f"{name} (" in description for name in VARIANTS)
