"""Tests of the Python module: physics that its arrays must show, and the command's numbers."""

import contextlib
import io
import json
import math
import os
import subprocess
import tempfile
import unittest

import numpy as np

import unhand

G = 9.81  # m/s^2
MASS, INERTIA = 0.246, 2.4e-3  # kg, kg m^2
COM_OFFSET, ANGLE = 0.10, -0.7  # m, rad
MU, RADIUS = 0.5, 0.0106  # -, m


def throw(model="limit_surface", hand=None, force=None, **law):
    """A bar held off its centre of mass by a hand that accelerates, then brakes."""
    hand = hand or unhand.hand_segments(
        0.0, (0.5, 0.9, 0.8), (1.8, 1.8, 2.0),
        [(0.03, (3, 3, 0), (0, 0, 0)), (0.20, (-8, -8, 0), (0, 0, 0))])
    force = force or unhand.opening_profile(
        open_command=0.02, grip_force=60, dead_time=0.01, opening_time=0.07, shape=2)
    return unhand.simulate_release(
        hand, force, unhand.contact_model(model, mu=MU, radius=RADIUS, **law),
        mass=MASS, inertia=INERTIA, com_offset=COM_OFFSET, angle=ANGLE)


def unhand_command(*arguments):
    subprocess.run([os.environ["UNHAND_COMMAND"], *arguments], check=True, capture_output=True)


class Readme(unittest.TestCase):
    def test_prints_what_it_says(self):
        with open(os.path.join(os.path.dirname(__file__), "README.md")) as page:
            program = page.read().split("```python\n")[1].split("```")[0]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(program, {})
        said = [line[3:] for line in program.splitlines() if line.startswith("#> ")]
        self.assertEqual(printed.getvalue().splitlines(), said)


class Flight(unittest.TestCase):
    def test_is_a_projectile(self):
        x, z, theta, vx, vz, omega = 0.7, 1.1, 0.3, 1.4, 1.5, 1.7
        flown = unhand.fly((x, z, theta), (vx, vz, omega))
        t = (vz + math.sqrt(vz**2 + 2 * G * z)) / G
        self.assertEqual(flown.outcome, "landed")
        self.assertAlmostEqual(flown.flight_time, t, delta=1e-14)
        np.testing.assert_allclose(flown.pose, [x + vx * t, 0, theta + omega * t], atol=1e-14)
        np.testing.assert_allclose(flown.twist, [vx, vz - G * t, omega], atol=1e-14)

    def test_drag_lift_and_wind_have_their_signs(self):
        def lands_at(**air):
            return unhand.fly((0, 1, 0), (2, 1, 5), **air).pose[0]

        self.assertLess(lands_at(drag_k=0.05), lands_at())
        self.assertGreater(lands_at(drag_k=0.05, wind=(1, 0)), lands_at(drag_k=0.05))
        # omega > 0 turns the velocity (J v is v turned by +90 degrees): what flies forward is lifted, and lands later.
        self.assertGreater(unhand.fly((0, 1, 0), (2, 0, 5), lift_km=0.02).flight_time,
                           unhand.fly((0, 1, 0), (2, 0, 5)).flight_time)

    def test_that_never_comes_down_says_so(self):
        self.assertEqual(unhand.fly((0, -1, 0), (1, 1, 0)).outcome, "never_reaches")


class Release(unittest.TestCase):
    def test_sticks_to_the_hand_until_it_slips(self):
        release = throw()
        self.assertEqual(release.outcome, "detached")
        slips = next(t for t, _, mode in release.events if mode == "slip")
        s = release.sample(np.linspace(0, slips - 1e-9, 50))
        self.assertEqual(set(s["mode"]), {"stick"})
        np.testing.assert_allclose(s["relative"], np.tile([COM_OFFSET, 0, ANGLE, 0, 0, 0], (50, 1)), rtol=0, atol=1e-15)
        angle = s["hand_pose"][:, 2] + ANGLE
        arm = COM_OFFSET * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        np.testing.assert_allclose(s["pose"][:, :2], s["hand_pose"][:, :2] + arm, atol=1e-14)

    def test_slips_on_the_ellipsoid(self):
        release = throw()
        slips = next(t for t, _, mode in release.events if mode == "slip")
        s = release.sample(np.linspace(slips + 1e-4, release.detach_time - 1e-4, 50))
        limit = 2 * MU * s["normal_force"]
        fx, fz, tau = s["wrench"].T
        np.testing.assert_allclose(np.hypot(np.hypot(fx, fz) / limit, tau / (2 / 3 * RADIUS * limit)), 1, rtol=1e-6)
        self.assertLess(np.max(fx * s["relative"][:, 3] + fz * s["relative"][:, 4] + tau * s["relative"][:, 5]), 0)

    def test_obeys_newton_and_closes_its_ledger(self):
        release = throw()
        h = 1e-4
        t = np.linspace(0.07, 0.095, 20)
        before, at, after = (release.sample(t + k * h) for k in (-1, 0, 1))
        acceleration = (after["twist"] - before["twist"]) / (2 * h)  # errs by h^2
        np.testing.assert_allclose(MASS * (acceleration[:, :2] + [0, G]), at["wrench"][:, :2], atol=1e-3)
        np.testing.assert_allclose((after["pose"] - before["pose"]) / (2 * h), at["twist"], atol=1e-5)
        self.assertLess(abs(release.energy["residual"]), 1e-7)
        self.assertLess(release.energy["linear_friction"], 0)
        np.testing.assert_allclose(release.sample([release.detach_time])["twist"][0], release.detach_twist, atol=1e-9)

    def test_of_a_sampled_throw_is_that_of_the_formula(self):
        t = np.arange(0, 0.12, 1e-3)
        pose, twist = np.array([0.5, 0.9, 0.8]), np.array([1.8, 1.8, 2.0])
        a = np.array([3.0, -2.0, 5.0])
        hand = unhand.hand_series(t, pose + np.outer(t, twist) + np.outer(t**2 / 2, a), twist + np.outer(t, a),
                                  np.tile(a, (len(t), 1)))
        formula = unhand.hand_segments(0.0, pose, twist, [(t[-1], a, (0, 0, 0))])
        u = np.clip((t - 0.03) / 0.07, 0, 1)
        force = unhand.force_series(t, 60 * (1 - u)**2, 1e-6)
        np.testing.assert_allclose(throw(hand=hand, force=force).detach_twist, throw(hand=formula).detach_twist, atol=1e-3)

    def test_of_pads_that_hardly_give_is_that_of_rigid_ones(self):
        def giving(compliance):
            return throw("limit_surface_disc", effects={"contact.pad_compliance.compliance": compliance,
                                                        "contact.pad_compliance.loss_time": 1e-3}).detach_twist

        rigid = throw("limit_surface_disc").detach_twist
        np.testing.assert_allclose(giving(1e-9), rigid, atol=2e-3)  # of 1.7 rad/s
        self.assertGreater(np.max(np.abs(giving(1e-5) - rigid)), 0.5)

    def test_gripper_delay_lets_go_when_it_is_told(self):
        law = unhand.contact_model("gripper_delay", open_command=0.02, delay=0.05)
        hand = unhand.hand_segments(0.0, (0.5, 0.9, 0.8), (1.8, 1.8, 2.0), [(0.2, (0, 0, 0), (0, 0, 0))])
        force = unhand.opening_profile(open_command=0.02, grip_force=60, opening_time=0.07)
        release = unhand.simulate_release(hand, force, law, mass=MASS, inertia=INERTIA)
        self.assertAlmostEqual(release.detach_time, 0.07, delta=1e-12)
        np.testing.assert_allclose(release.detach_twist, [1.8, 1.8, 2.0], atol=1e-12)


class Errors(unittest.TestCase):
    def says(self, words, function, *arguments, **named):
        with self.assertRaises((ValueError, IndexError, RuntimeError)) as caught:
            function(*arguments, **named)
        for word in words:
            self.assertIn(word, str(caught.exception))

    def test_name_what_is_wrong(self):
        self.says(["mu", "-1", "[0, 10]"], unhand.contact_model, "limit_surface", mu=-1)
        self.says(["limit_surfaces", "limit_surface_disc"], unhand.contact_model, "limit_surfaces")
        self.says(["limit_surface", "kappa"], unhand.contact_model, "limit_surface", kappa=0.5)
        self.says(["contact.adhesion.f_adh", "contact.viscous"], unhand.contact_model, "limit_surface",
                  effects={"contact.adhesion.f_adh": 0.1})
        self.says(["pose", "(5, 2)", "(N, 3)"], unhand.hand_series, np.arange(5.0), np.zeros((5, 2)), np.zeros((5, 3)),
                  np.zeros((5, 3)))
        self.says(["9", "[0, 0.1]"], throw().sample, [9.0])
        self.says(["no_such_file.h5"], unhand.read_log, "no_such_file.h5")


class Log(unittest.TestCase):
    def test_throws_are_those_that_the_command_compares(self):
        with tempfile.TemporaryDirectory() as folder:
            log, out = os.path.join(folder, "log.h5"), os.path.join(folder, "out.json")
            unhand_command("generate", "quick12", "--seed", "3", "--out", log)
            unhand_command("compare", log, "--models", "limit_surface_disc", "--write-cards", folder)
            unhand_command("predict", log, "--card", os.path.join(folder, "limit_surface_disc.json"), "--json", out)
            with open(out) as file:
                predicted = json.load(file)
            p = predicted["parameters"]
            law = unhand.contact_model("limit_surface_disc", mu=p["mu"], radius=1.5 * p["length"])  # L = 2/3 a
            throws = unhand.read_log(log)
        self.assertEqual([t.id for t in throws], [t["id"] for t in predicted["throws"]])
        for mine, theirs in zip(throws, predicted["throws"]):
            release = mine.simulate_release(law)
            flown = unhand.fly(release.detach_pose, release.detach_twist, gravity=mine.gravity, drag_k=mine.drag_k,
                               landing_height=mine.landing_height)
            self.assertAlmostEqual(release.detach_time, theirs["detach"]["time_s"], delta=1e-9)
            self.assertAlmostEqual(math.degrees(release.detach_twist[2]), theirs["detach"]["omega_deg_s"], delta=1e-5)
            self.assertAlmostEqual(flown.pose[0], theirs["landing"]["x_m"], delta=1e-7)
            self.assertEqual(mine.measured["landing_x"], theirs["measured"]["landing_x_m"])


if __name__ == "__main__":
    unittest.main()
