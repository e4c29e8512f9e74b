"""One order of what may be added to a controller's choices."""

from poise.baselines.balance.references import targets as offsets
from poise.baselines.environments.scales import ResidualScales, StepScales


def test_each_name_is_once_in_the_order():
    assert offsets.NAMES == (*offsets.TARGETS, *offsets.STEPS)


def test_actions_scale_what_they_are_called():
    """A scale of its own for each field appears under that field's names."""
    fields = ("com", "cop", "height", "lean", "momentum", "foothold", "time", "trigger")
    scales = dict(zip(fields, range(1, 9), strict=True))
    entries = StepScales(**scales).entries()
    assert tuple(entries) == offsets.NAMES and tuple(ResidualScales().entries()) == offsets.TARGETS
    for name, value in entries.items():
        field = "height" if name == "com_z" else name.removesuffix("_x").removesuffix("_y")
        assert value == scales[field], name


def test_step_offsets_are_read_where_they_are_written():
    """Each part moves the entries of its name, and no others."""
    for field, part in offsets.no_offsets().named().items():
        if field == "values":
            continue
        step = offsets.no_offsets()
        step.named()[field][:] = 1.0
        assert part.base is not None
        moved = {name for name, value in zip(offsets.NAMES, step.values, strict=True) if value}
        pair = {f"{field}_x", f"{field}_y"}
        assert moved == (pair if field in ("com", "cop", "lean", "momentum", "foothold") else
                         {"com_z" if field == "height" else field})  # fmt: skip
