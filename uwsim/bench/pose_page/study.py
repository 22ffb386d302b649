"""The numbers of the pose benchmark on pictures, read by the groups of its recipe."""

from uwsim.bench.study import StudyByCondition

ROTATION, TRANSLATION = "rotation_error_deg", "translation_error_percent"
ERRORS = (ROTATION, TRANSLATION)
BEST, REFINED, IGNORING, PRINTED = "best", "port_refined", "pinhole_ignoring_port", "parallel_weighted"
SEARCHED, DEBLURRED = "port_refined_search", "port_refined_deblurred"
RESTORED = ("port_refined_dual_transmission", "port_refined_clahe")
OF_COLUMN = {
    "DLT": "dlt", "EPnP": "epnp", "EPnP+GN": "epnp_gn", "DLS": "dls", "LHM": "lhm", "RPnP": "rpnp", "OPnP": "opnp",
    "Parallel": "parallel", "Ours": PRINTED,
}  # fmt: skip
"""Columns of tables 5.1 to 5.5 and the solvers here that answer to them."""
TABLES, TURBID, THICK, TEN, MOTION = "bipyramid", "bipyramid_turbid", "thick_port", "random", "bipyramid_motion"
BOARDS, BOARDS_MOTION = "apriltag", "apriltag_motion"


class PictureStudy(StudyByCondition):
    """A result of the pose benchmark on pictures, read by name."""

    def row(self, distance_mm: int, off_axis_mm: int) -> list[str]:
        """Return the cases of a row of tables 5.1 to 5.5."""
        return self.cases(group=TABLES, distance_mm=distance_mm, off_axis_mm=off_axis_mm)

    def turbid(self, water: str, distance_mm: int | None = None) -> list[str]:
        """Return the cases of six spheres on the axis in a water, at the places and tilts of the turbid ones."""
        turbid = self.cases(group=TURBID)
        places = {(self.conditions[case]["distance_mm"], self.conditions[case]["tilt_deg"]) for case in turbid}
        found = [case for case in self.cases(group=(TABLES, TURBID), water=water, off_axis_mm=0)
                 if (self.conditions[case]["distance_mm"], self.conditions[case]["tilt_deg"]) in places]  # fmt: skip
        return [case for case in found if distance_mm in (None, self.conditions[case]["distance_mm"])]

    def shown(self, *names: str) -> list[str]:
        """Return those of the methods that took part."""
        return [name for name in names if name in self.methods]
