"""What the tests of mechanisms ask of a compiled model."""

SORTS = {
    "geom": "ngeom", "body": "nbody", "joint": "njnt", "pair": "npair", "site": "nsite", "tendon": "ntendon",
    "actuator": "nu",
}  # fmt: skip


def unnamed(model) -> list[tuple[str, int]]:
    """(sort, id) of what has no name in a model."""
    things = [(sort, i) for sort, count in SORTS.items() for i in range(getattr(model, count))]
    return [(sort, i) for sort, i in things if not getattr(model, sort)(i).name]
