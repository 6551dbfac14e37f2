"""Scenes before a camera nearby: what a wrong ray, frame or edge would put into every photograph."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reflectance_fit.data_synthetic.arrangement import silhouette
from reflectance_fit.data_synthetic.camera import Camera, picture_angle
from reflectance_fit.data_synthetic.perspective import INK, PAPER, BallScene, BoardScene
from reflectance_fit.data_synthetic.picture import Optics, stokes_image
from reflectance_fit.data_synthetic.scenes import FlatScene, SphereScene
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.target import BESIDE, BLACK, WHITE, Board, Print
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.physics.stokes import linear, unpolarized

GLASS, GOLD = (1.519, 0.0), (0.424, 2.472)
CAMERA = Camera(2100.0, (499.5, 374.5))
Z = np.array([0.0, 0.0, 1.0])
TILTS = st.tuples(st.floats(0.0, 65.0), st.floats(-180.0, 180.0), st.floats(-20.0, 20.0))
PIXELS = st.tuples(st.floats(440.0, 560.0), st.floats(315.0, 435.0))


def placed(tilt_deg, axis_deg, roll_deg=0.0, light=None, **board):
    """A board 320 mm away, its middle on the optical axis."""
    board = Board(**board)
    axis = np.radians(axis_deg)
    tilt = Rotation.from_rotvec(np.radians(tilt_deg) * np.array([np.cos(axis), -np.sin(axis), 0.0]))
    rotation = (tilt * Rotation.from_euler("z", roll_deg, degrees=True)).as_matrix()
    middle = np.array([*(np.array(board.size_mm) / 2), 0.0])
    shift = np.array([0.0, 0.0, 320.0]) - rotation @ middle
    return BoardScene(CAMERA, board, rotation, shift, unpolarized() if light is None else light, 0.001)


def rendered(scene, optics=None, width=1000, height=750, shift=(0.0, 0.0)):
    """S0 of every pixel; the sample is glass."""
    sensor = Sensor(width=width, height=height, pattern="MONO")
    return stokes_image(scene, sensor, {"mono": GLASS}, optics or Optics(), shift)[..., 0]


@given(TILTS, PIXELS)
def test_each_pixel_has_its_own_angle_and_plane_of_incidence(pose, at):
    """Against mirror vectors, and a rotation by Rodrigues' formula that turns the ray into the optical axis."""
    scene = placed(*pose, light=linear(0.4), window_mm=(100.0, 75.0))
    (ray,) = CAMERA.rays([at[0]], at[1])
    normal = -scene.rotation[:, 2]
    theta, s_axis = scene.incidence(*at)
    assert np.cos(theta) == pytest.approx(-ray @ normal, abs=1e-12)
    lamp = ray - 2 * (ray @ normal) * normal
    assert lamp @ normal == pytest.approx(np.cos(theta), abs=1e-12)
    s = np.cross(ray, lamp)
    axis = np.cross(ray, Z)
    sine = np.linalg.norm(axis)
    turn = Rotation.from_rotvec(axis / sine * np.arcsin(sine) if sine > 1e-9 else np.zeros(3))
    x, y, z = turn.apply(s / max(np.linalg.norm(s), 1e-9))
    assert z == pytest.approx(0.0, abs=1e-9)
    if theta > 1e-3:
        assert np.sin(s_axis - np.arctan2(-y, x)) == pytest.approx(0.0, abs=1e-7)
        # The flat scene at this angle and direction shows the same light.
        flat = FlatScene((0, 0, 9, 9), np.degrees(theta), linear(0.4), np.degrees(s_axis))
        assert scene.stokes(*at, *GOLD) == pytest.approx(flat.stokes(4, 4, *GOLD), abs=1e-9)


def test_on_the_optical_axis_the_picture_shows_directions_as_they_are():
    for degrees in (0.0, 30.0, 90.0, 150.0):
        up = np.radians(degrees)
        seen = picture_angle(Z, np.array([np.cos(up), -np.sin(up), 0.0]))
        assert np.degrees(seen) == pytest.approx(degrees)


@pytest.mark.parametrize("pose", [(0, 0, 0), (45, 0, 5), (60, 30, -8), (65, 90, 0)])
def test_opencv_finds_the_board_where_it_is(pose):
    """OpenCV's own detector against OpenCV's own projection, whose own corners stray by 0.1 px, some by more."""
    scene = placed(*pose, square_mm=16.0, marker_mm=12.0, squares=(7, 5), window_mm=(24.0, 18.0))
    picture = rendered(scene, Optics(blur_px=0.7))
    board = scene.board
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    layout = cv2.aruco.CharucoBoard(board.squares, board.square_mm, board.marker_mm, dictionary)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.CharucoDetector(layout, cv2.aruco.CharucoParameters(), parameters)
    grey = np.round(np.clip(picture / PAPER, 0, 1.2) * 200).astype(np.uint8)
    corners, numbers = detector.detectBoard(grey)[:2]
    points = np.asarray(layout.getChessboardCorners())[numbers.ravel()].astype(float)
    matrix = np.array([[2100.0, 0, 499.5], [0, 2100.0, 374.5], [0, 0, 1]])
    rotation = cv2.Rodrigues(scene.rotation)[0]
    true = cv2.projectPoints(points, rotation, scene.shift_mm, matrix, None)[0].reshape(-1, 2)
    # Corners beside the window may be those of the sample, not of squares.
    x0, y0, x1, y1 = board.window
    clear = np.abs(points[:, :2] - [(x0 + x1) / 2, (y0 + y1) / 2]) > np.array([x1 - x0, y1 - y0]) / 2 + 5
    clear = clear.any(axis=1)
    error = (corners.reshape(-1, 2) - true)[clear]
    assert len(error) >= 16
    assert np.abs(error).max() < 0.3
    assert np.median(np.abs(error)) < 0.05
    found = cv2.solvePnP(points[clear], corners.reshape(-1, 2)[clear].astype(float), matrix, None)[1]
    # Bounded by the corners' errors: 0.03 px over a board of 600 px.
    assert cv2.Rodrigues(found)[0][:, 2] == pytest.approx(scene.rotation[:, 2], abs=np.radians(0.03))


def printed(board, x, y):
    """What points of the paper show, in mm, of a board with no window."""
    return Print(replace(board, window_mm=(0.0, 0.0))).part(x, y, np.eye(3), np.eye(3))


def test_the_ink_is_opencv_s():
    """Every printed module of a picture of the board that OpenCV makes itself."""
    board = Board(square_mm=9.0, marker_mm=7.0)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    layout = cv2.aruco.CharucoBoard(board.squares, 9.0, 7.0, dictionary)
    picture = layout.generateImage((11 * 18, 8 * 18))  # two pixels a module, module and margin alike
    y, x = (np.indices(picture.shape) + 0.5) / 2.0
    assert np.array_equal(printed(board, x, y), np.where(picture < 128, BLACK, WHITE))
    # White paper goes on around it for a centimetre.
    assert np.array_equal(printed(board, [-0.1, 99.1, 5.0], [5.0, 5.0, 72.1]), [WHITE] * 3)
    assert np.array_equal(printed(board, [-10.1, 109.1, 5.0], [5.0, 5.0, 82.1]), [BESIDE] * 3)


def test_a_print_out_of_scale_is_larger_than_it_says():
    larger = Board(print_scale=(1.02, 0.99))
    x, y = np.random.default_rng(0).uniform(0.0, (110.0, 80.0), (5000, 2)).T
    assert np.array_equal(printed(larger, 1.02 * x, 0.99 * y), printed(Board(), x, y))
    assert larger.size_mm == pytest.approx((112.2, 79.2))


@pytest.mark.parametrize("offset", [0.0, 6.0])
def test_the_sample_is_where_its_corners_project(offset):
    scene = placed(55.0, 20.0, sample_offset_mm=offset)
    x0, y0, x1, y1 = scene.board.window
    corners = np.array([[x, y, -offset] for x in (x0, x1) for y in (y0, y1)])
    middle = corners.mean(axis=0)
    for corner in corners:
        for share, inside in ((0.98, True), (1.02, False)):
            point = scene.rotation @ (middle + share * (corner - middle)) + scene.shift_mm
            s0 = scene.stokes(*CAMERA.pixels(point), *GLASS)[0]
            assert (s0 not in (INK, PAPER, 0.001)) == inside


def test_parts_of_the_board_shine_as_they_should():
    scene = placed(40.0, 0.0)
    values = rendered(scene)
    for light in (INK, PAPER, 0.001):
        assert np.count_nonzero(np.isclose(values, light)) > 10000


def test_a_pixel_is_the_mean_over_its_area():
    """Against 900 points a pixel, over a strip full of edges."""
    scene = placed(50.0, 25.0)
    values = rendered(scene)[230:260, 300:360]
    fine = (np.arange(30) + 0.5) / 30 - 0.5
    x, y = np.arange(300, 360), np.arange(230, 260)
    literal = (
        scene.stokes((x[:, None] + fine).ravel(), (y[:, None] + fine).ravel()[:, None], *GLASS)[..., 0]
        .reshape(30, 30, 60, 30)
        .mean(axis=(1, 3))
    )
    assert np.ptp(literal) > 0.8 * (PAPER - INK)
    assert values == pytest.approx(literal, abs=0.04 * PAPER)
    assert abs(np.mean(values - literal)) < 3e-4 * PAPER


def test_blur_is_gaussian_and_keeps_the_light():
    scene = placed(50.0, 25.0)
    sharp, soft = rendered(scene), rendered(scene, Optics(blur_px=1.5))
    assert soft.mean() == pytest.approx(sharp.mean(), rel=1e-3)
    weights = np.exp(-0.5 * (np.arange(-8, 9) / 1.5) ** 2)
    kernel = np.outer(weights, weights) / weights.sum() ** 2
    for y, x in ((210, 320), (390, 500), (250, 610)):
        literal = np.sum(kernel * sharp[y - 8 : y + 9, x - 8 : x + 9])
        assert soft[y, x] == pytest.approx(literal, rel=1e-3)


def test_blur_mixes_light_not_colours():
    """The same scene on a Bayer sensor: where all colours see alike, the mosaic is the grey picture."""
    scene = placed(50.0, 25.0)
    grey = rendered(scene, Optics(blur_px=1.0))
    bayer = Sensor(width=1000, height=750)
    colour = stokes_image(scene, bayer, dict.fromkeys("RGB", GLASS), Optics(blur_px=1.0))[..., 0]
    assert np.array_equal(colour, grey)


@pytest.mark.parametrize("shift", [(0.37, -0.81), (3.0, 2.0)])
def test_a_shifted_picture_is_the_scene_at_moved_points(shift):
    """By OpenCV's registration, which shares nothing with how the picture was made."""
    scene = placed(30.0, 0.0)
    still, moved = (rendered(scene, Optics(blur_px=1.2), shift=s) for s in ((0.0, 0.0), shift))
    found = cv2.findTransformECC(still, moved, np.eye(2, 3, dtype=np.float32), cv2.MOTION_TRANSLATION)[1]
    assert found[:, 2] == pytest.approx(shift, abs=0.005)


def test_the_wedge_goes_round_with_the_analyzer():
    optics = Optics(wedge_px=2.0)
    assert optics.shift_px(0.0) == pytest.approx((2.0, 0.0))
    assert optics.shift_px(90.0) == pytest.approx((0.0, -2.0))  # up, as the picture is displayed
    assert Optics().shift_px(45.0) == (0.0, 0.0)


@given(at=st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)), distance=st.floats(4.0, 50.0))
def test_a_ball_nearby_against_a_quadratic_equation(at, distance):
    centre = distance * CAMERA.rays(560.0, 310.0)
    scene = BallScene(CAMERA, centre, unpolarized())
    edge = 2100.0 / distance
    x, y = 560.0 + at[0] * edge, 310.0 + at[1] * edge
    (ray,) = CAMERA.rays([x], y)
    theta, s_axis = scene.incidence(x, y)
    roots = np.roots([1.0, -2 * ray @ centre, centre @ centre - 1.0])
    if not np.all(np.isreal(roots)):
        assert np.isnan(theta)
        assert scene.stokes(x, y, *GLASS) == pytest.approx(unpolarized())
        return
    normal = ray * roots.real.min() - centre
    if np.sin(theta) > 1e-3 and np.cos(theta) > 1e-3:
        assert np.cos(theta) == pytest.approx(-ray @ normal, abs=1e-6)
        across = np.cross(normal, ray)
        assert np.sin(s_axis - picture_angle(ray, across)) == pytest.approx(0.0, abs=1e-6)


def test_a_ball_from_afar_is_the_ball_without_perspective():
    far = Camera(1e7, (200.0, 150.0))
    near = BallScene(far, far.rays(210.0, 140.0) * np.hypot(1e7, 100.0) / 100.0, unpolarized())
    afar = SphereScene((210.0, 140.0), 100.0, unpolarized())
    x, y = np.arange(120, 300, 7), np.arange(50, 230, 7)[:, None]
    assert near.stokes(x, y, *GOLD) == pytest.approx(afar.stokes(x, y, *GOLD), abs=1e-4)


def test_the_silhouette_bounds_the_ball_and_touches_it():
    centre = 5.0 * CAMERA.rays(700.0, 200.0)
    scene = BallScene(CAMERA, centre, unpolarized())
    x0, y0, x1, y1 = silhouette(CAMERA, centre)
    x, y = np.linspace(x0 - 5, x1 + 5, 1201), np.linspace(y0 - 5, y1 + 5, 1201)
    on = np.isfinite(scene.incidence(x, y[:, None])[0])
    columns, rows = x[on.any(axis=0)], y[on.any(axis=1)]
    assert (columns[0], columns[-1]) == pytest.approx((x0, x1), abs=1.0)
    assert (rows[0], rows[-1]) == pytest.approx((y0, y1), abs=1.0)
    assert columns[0] >= x0
    assert columns[-1] <= x1


def test_near_the_rim_a_pixel_is_the_mean_over_its_area():
    """Reflection falls with the square root of the distance from the rim: a pixel's middle says little."""
    scene = BallScene(CAMERA, 6.0 * CAMERA.rays(499.5, 374.5), unpolarized())
    x1 = silhouette(CAMERA, scene.centre)[2]
    columns = np.arange(int(x1) - 3, int(x1) + 3)
    values = rendered(scene)[374, columns]
    fine = (np.arange(60) + 0.5) / 60 - 0.5
    literal = scene.stokes((columns[:, None] + fine).ravel(), 374.0 + fine[:, None], *GLASS)[..., 0]
    assert values == pytest.approx(literal.reshape(60, 6, 60).mean(axis=(0, 2)), abs=3e-3)


def test_several_indices_at_once_are_one_at_a_time():
    scenes = [
        placed(50.0, 10.0),
        BallScene(CAMERA, 6.0 * CAMERA.rays(499.5, 374.5), unpolarized()),
        SphereScene((500.0, 370.0), 80.0, unpolarized()),
        FlatScene((480, 360, 520, 380), 40.0, linear(0.3), 20.0),
    ]
    x, y = np.arange(440, 560, 3), np.arange(350, 400, 3)[:, None]
    for scene in scenes:
        both = scene.stokes(x, y, np.array([1.519, 0.424]), np.array([0.0, 2.472]))
        assert np.array_equal(both, [scene.stokes(x, y, *GLASS), scene.stokes(x, y, *GOLD)])


def test_impossible_boards():
    with pytest.raises(ReflectanceFitError, match="DICT_5X5_100"):
        Board(dictionary="DICT_9X9")
    with pytest.raises(ReflectanceFitError, match="smaller than squares"):
        Board(marker_mm=10.0)
