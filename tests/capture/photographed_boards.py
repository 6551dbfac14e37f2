"""Boards photographed by OpenCV's own projection and by a caster of rays: known truth, no code of ours."""

import math

import cv2
import numpy as np

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.corners import Corners

BOARD = Board()
SHAPE = (1334, 2000)
FOCAL, CENTRE, DISTORTION = 4200.0, (1010.0, 650.0), (-0.1, 0.05)
MATRIX = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]])


def pose(tilt_deg: float, turn_deg: float = 0.0, off_mm=(0.0, 0.0, 0.0)):
    """Rotation and translation that put the board's middle 320 mm before the camera, leaning back by ``tilt_deg``."""
    lean = cv2.Rodrigues(np.array([math.radians(tilt_deg), 0.0, 0.0]))[0]
    rotation = lean @ cv2.Rodrigues(np.array([0.0, 0.0, math.radians(turn_deg)]))[0]
    middle = np.array([*np.array(BOARD.size_mm) / 2, 0.0])
    return rotation, np.array([0.0, 0.0, 320.0]) + np.array(off_mm) - rotation @ middle


def projected(rotation, translation, points):
    seen, _ = cv2.projectPoints(
        points, cv2.Rodrigues(rotation)[0], translation, MATRIX, np.array([*DISTORTION, 0.0, 0.0])
    )
    return np.reshape(seen, (-1, 2))


def corners(rotation, translation, rng, noise=0.03, stretch=1.0, bow_mm=(0.0, 0.0)) -> Corners:
    """What a photograph of a print that is ``stretch`` too wide and bowed would give."""
    flat = BOARD.corners_mm()
    middle, half = (flat.min(0) + flat.max(0)) / 2, np.ptp(flat, axis=0) / 2
    points = flat.copy()
    points[:, 0] = middle[0] + stretch * (flat[:, 0] - middle[0])
    points[:, 2] = (1 - ((flat - middle)[:, :2] / half[:2]) ** 2) @ np.array(bow_mm)
    xy = projected(rotation, translation, points)
    xy = xy + noise * rng.normal(size=xy.shape)
    inside = (xy > 0).all(axis=1) & (xy < SHAPE[::-1]).all(axis=1)
    return Corners(np.flatnonzero(inside), xy[inside], SHAPE)


def incidence_deg(rotation, pixel) -> float:
    """Between the board's normal and the ray of a pixel, by OpenCV."""
    place = cv2.undistortPoints(np.array([[pixel]], dtype=float), MATRIX, np.array([*DISTORTION, 0, 0]))
    ray = np.array([*np.reshape(place, 2), 1.0])
    return math.degrees(math.acos(ray @ rotation[:, 2] / np.linalg.norm(ray)))


def photographed(rotation, translation, rng, noise=0.004, blur=0.8, fine=3):
    """A picture of the printed board, float, white 1: rays through a grid finer than the pixels, averaged."""
    pixels = 40  # of OpenCV's picture a square
    print_ = BOARD.opencv().generateImage(
        (BOARD.squares[0] * pixels, BOARD.squares[1] * pixels), marginSize=0
    )
    paper = np.pad(print_, pixels, constant_values=255).astype(np.float32) / 255
    height, width = SHAPE
    y, x = (np.mgrid[0 : height * fine, 0 : width * fine] + 0.5) / fine - 0.5
    u, v = (x - CENTRE[0]) / FOCAL, (y - CENTRE[1]) / FOCAL
    seen_u, seen_v = u, v
    for _ in range(8):
        square = u * u + v * v
        stretch = 1 + square * (DISTORTION[0] + square * DISTORTION[1])
        u, v = seen_u / stretch, seen_v / stretch
    # The plane z = 0 of the board: solve R p + t = s (u, v, 1).
    towards = np.stack([u, v, np.ones_like(u)], axis=-1) @ rotation
    at = rotation.T @ translation
    scale = at[2] / towards[..., 2]
    place = scale[..., None] * towards[..., :2] - at[:2]
    # The board's zero is the corner of the pixel after the padding.
    to = (place * pixels / BOARD.square_mm + pixels - 0.5).astype(np.float32)
    picture = cv2.remap(
        paper, to[..., 0], to[..., 1], cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0.5
    )
    picture = picture.reshape(height, fine, width, fine).mean(axis=(1, 3))
    picture = 0.04 + 0.8 * cv2.GaussianBlur(picture, (0, 0), blur)
    return picture + noise * rng.normal(size=picture.shape)
