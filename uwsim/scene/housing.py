"""What surrounds a lamp or a camera: a black, closed cylinder."""

from uwsim.scene.base import Positive, Strict


class Housing(Strict):
    """Cylinder about the optical axis of what it holds, from its front face backwards; black, without water inside.

    The front face is where the water begins in front of the glass: the outer face of a flat window or port, the plane
    through the centre of a dome (which stands out of the face), the plane of the source or pinhole without either.
    Light is neither reflected nor passed by it; glass and source in the front face work as they do without a housing.
    """

    radius_m: Positive
    length_m: Positive
