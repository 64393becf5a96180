// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// Section 5.1, Fig. 11: the HIP goes along a flat grid, above it and below it.
Experiment flat_experiment();
/// Section 5.1: ticks and steps to the surface after the HIP jumps below it.
Experiment jump_experiment();
/// Section 5.3, Fig. 14: a triangle wave whose amplitude grows.
Experiment corners_experiment();
/// Fig. 12: one lift over time.
Experiment single_lift_experiment();
/// Section 5.2: a flat cloud rises at 20 r_c/s to the proxy, then accelerates for 10 frames.
Experiment lift_experiment();
/// Section 6: h and e_n of (23) and (24), and the bound (25).
Experiment bound_experiment();
/// The highest velocity at which a flat cloud can rise.
Experiment speed_experiment();
/// A flat cloud that comes out of free space at a constant velocity.
Experiment first_contact_experiment();
/// A resting plane under fresh noise in every frame: is it lost, and what does the hand feel?
Experiment hold_experiment();
/// What the hand feels while the surface moves: 1 Hz, 20 mm.
Experiment force_experiment();
/// Section 4.6: what damping does to a hand that goes back and forth in a resting plane.
Experiment damping_experiment();
/// Section 5.4, Fig. 16: over a ramp and a box as a Kinect sees them, or across a recording.
Experiment scan_experiment();
/// How near the rendered contact and force are to the true ones, white noise and a real camera's,
/// beside its aims. Takes some seconds a method.
Experiment fidelity_experiment();
/// What a hand feels with a method, in the open loop, with a device and a hand in the loop, and
/// through the safety chain, beside the aims. docs/feel.md says what is measured, and how.
Experiment feel_experiment();
/// How stiff a surface may be before the loop of device, hand and method swings: the largest
/// stiffness that decays, by device, hand, scene, method, damping and way. docs/feel.md says what
/// is measured, and how.
Experiment zwidth_experiment();
/// What a hand on a known way feels of each of the standard materials: a strike, a slow press and a
/// stroke, through the whole chain.
Experiment materials_experiment();
/// A hand that leads a robot over a link, by the ways of teleop_ways(): what the hand feels and
/// what the robot does, by delay. docs/teleop.md says what is measured.
Experiment teleop_experiment();
/// Hands that lead a robot at random, while the link, the camera or one of the two processes fails:
/// does the robot break a fixture, press too hard or continue? docs/teleop.md.
Experiment teleop_faults_experiment();
/// Does a method keep the proxy on the right side? Families of cases drawn at random, each failure
/// shrunk to the simplest case that still fails. docs/pop.md has the rules.
Experiment pop_experiment();
/// The field set: scenes, sensors and hands that share no code with the generator that methods were
/// made with. docs/field.md has the rules.
Experiment field_experiment();
/// The visits set: things, people and surfaces that come, go and move around a hand that rests or
/// works, drawn and judged as those of the field set. docs/field.md has the classes.
Experiment visits_experiment();
/// Pressing, holding and sliding on what a real camera measured, at rest and moved exactly: patches
/// cut out of the recorded frames, with their noise, are moved along or across the lines of sight.
Experiment real_experiment();

}  // namespace palpate::lab
