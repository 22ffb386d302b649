"""Tables of the pose benchmark on pictures: printed beside ours, turbidity, ports, motion, names of spheres."""

from collections.abc import Iterable

from uwsim.bench.judged import shown
from uwsim.bench.pnp_page.printed import Table
from uwsim.bench.pose_page.study import (
    BEST,
    BOARDS,
    BOARDS_MOTION,
    DEBLURRED,
    ERRORS,
    IGNORING,
    MOTION,
    OF_COLUMN,
    REFINED,
    RESTORED,
    ROTATION,
    SEARCHED,
    TABLES,
    TEN,
    TRANSLATION,
    PictureStudy,
)
from uwsim.bench.records import markdown_table
from uwsim.bench.study import title

OWN = (BEST, REFINED, IGNORING)
_COLUMNS = {
    "detected_percent": "poses [%]", "points_found_percent": "points found [%]",
    "corner_error_px": "points off by [px]",
    "points_covered_percent": "in their 90 % ellipse [%]", ROTATION: "rotation [deg]", TRANSLATION: "translation [%]",
}  # fmt: skip


def beside_printed(table: Table, study: PictureStudy, quantity: str) -> str:
    """Return one of tables 5.1 to 5.5: mean errors as printed, and below each row ours; rotation or translation."""
    metric = dict(zip(("rotation_deg", "translation_percent"), ERRORS, strict=True))[quantity]
    own = study.shown(*OWN)
    rows = []
    for aside, printed in getattr(table, quantity).items():
        cases = study.row(table.depth_mm, int(aside))
        rows.append([aside, "printed", *(f"{value:.2f}" for value in printed), *["" for _ in own]])
        ours = [study.mean(name, metric, cases) for name in (*OF_COLUMN.values(), *own)]
        rows.append(["", f"here, {len(cases)}", *(shown(value, 2) for value in ours)])
    return markdown_table(["from the axis [mm]", "", *OF_COLUMN, *map(title, own)], rows, texts=2)


def poses(study: PictureStudy) -> str:
    """Return in how many of the pictures of these tables who has a pose: means are over those."""
    cases = study.cases(group=TABLES)
    every = {title(name): study.mean(name, "detected_percent", cases) for name in study.shown(*OWN)}
    every = {column: study.mean(name, "detected_percent", cases) for column, name in OF_COLUMN.items()} | every
    fewer = [f"{name} in {shown(share, 1)} %" for name, share in every.items() if share < 100]
    return f"Means are over the pictures with a pose: {', '.join([*fewer, 'all others' if fewer else 'all'])} in each."


def _by(study: PictureStudy, groups: Iterable[tuple[str, list[str]]], methods: Iterable[str], what: str) -> str:
    """Return a table of _COLUMNS, a row for each method and group that has cases; empty if none has."""
    rows = []
    for words, cases in groups:
        for method in study.shown(*methods) if cases else ():
            numbers = [shown(study.summary(method, metric, cases), 2) for metric in _COLUMNS]
            rows.append([words, title(method), str(len(cases)), *numbers])
            words = ""
    return markdown_table([what, "solver", "cases", *_COLUMNS.values()], rows, texts=2) if rows else ""


def in_short(study: PictureStudy) -> str:
    """Return what ignoring the port, a pinhole in water and the port itself give, by group."""
    groups = dict.fromkeys(one["group"] for one in study.conditions.values())
    return _by(
        study, [(title(group), study.cases(group=group)) for group in groups], (IGNORING, BEST, REFINED), "group"
    )


def turbidity(study: PictureStudy) -> str:
    """Return what water and restoration do to six spheres on the axis and to boards."""
    waters = list(dict.fromkeys(one["water"] for one in study.conditions.values()))
    groups = [(f"six spheres, {title(water)}", study.turbid(water)) for water in waters]
    groups += [(f"AprilTags, {title(water)}", study.cases(group=BOARDS, water=water)) for water in waters]
    return _by(study, groups, (IGNORING, BEST, REFINED, *RESTORED), "water")


def turbid_distances(study: PictureStudy) -> str:
    """Return errors of six spheres on the axis by water and distance."""
    groups = []
    for water in dict.fromkeys(one["water"] for one in study.conditions.values()):
        for far in study.steps("distance_mm", study.turbid(water)):
            groups.append((f"{title(water)}, {far} mm", study.turbid(water, far)))
    return _by(study, groups, (REFINED,), "water, distance")


def ports(study: PictureStudy) -> str:
    """Return what a solver loses that takes a lens behind a port for a pinhole."""
    groups = []
    for port, marks in dict.fromkeys((one["port"], one["marks"]) for one in study.conditions.values()):
        cases = study.cases(port=port, marks=marks, group=tuple(_still(study)))
        for aside in study.steps("off_axis_mm", cases):
            groups.append((f"{port}, {marks}, {aside} mm off the axis", [c for c in cases
                          if study.conditions[c]["off_axis_mm"] == aside]))  # fmt: skip
    return _by(study, groups, (IGNORING, BEST, REFINED), "port")


def motion(study: PictureStudy) -> str:
    """Return what motion blur does, and what deblurring before detection is worth."""
    groups = []
    for words, group in (("six spheres", MOTION), ("AprilTags", BOARDS_MOTION)):
        for blur in study.steps("blur_px", study.cases(group=group)):
            groups.append((f"{words}, {blur:g} px", study.cases(group=group, blur_px=blur)))
    return _by(study, groups, (REFINED, DEBLURRED), "blur")


def names(study: PictureStudy) -> str:
    """Return how often a search tells the spheres apart."""
    groups = [(title(group), study.cases(group=group)) for group in dict.fromkeys(
        one["group"] for one in study.conditions.values() if one["marks"] != "markers")]  # fmt: skip
    rows = []
    for words, cases in groups:
        for method in study.shown(REFINED, SEARCHED):
            right = study.mean(method, "points_right_percent", cases)
            poses = study.mean(method, "detected_percent", cases)
            errors = [shown(study.median(method, metric, cases), 2) for metric in ERRORS]
            how = "by a search" if method == SEARCHED else "by true places"
            rows.append([words, how, str(len(cases)), shown(poses, 1), shown(right, 1), *errors])
            words = ""
    head = ["group", "told apart", "cases", "poses [%]", "names right [%]", "rotation [deg]", "translation [%]"]
    return markdown_table(head, rows, texts=2) if rows else ""


def _still(study: PictureStudy) -> list[str]:
    groups = dict.fromkeys(one["group"] for one in study.conditions.values())
    return [group for group in groups if group not in (MOTION, BOARDS_MOTION)]


def ten(study: PictureStudy) -> list[str]:
    """Return the cases of ten points without a symmetry."""
    return study.cases(group=TEN)
