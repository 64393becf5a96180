/* SPDX-License-Identifier: Apache-2.0 */
#ifndef PALPATE_SERVO_LAST_GATE_H
#define PALPATE_SERVO_LAST_GATE_H

/* The last step before a device's write: bounds every force and torque, whatever the stages before
   it computed. In C, small, without heap and loops, so that provers can decide it for all inputs:
   docs/safety.md says what is proved, and scripts/prove does it. */

#ifdef __cplusplus
extern "C" {
#endif

struct palpate_gate_vector {
  double x, y, z;
};

/* What user and device allow of a force [N] or a torque [N m]. */
struct palpate_gate_bounds {
  double limit; /* [N] the lower of the user's and the device's, 0 to 1000 */
  double rise;  /* [N/s] that a tick may add, 0 to 1e6 */
  double fall;  /* [N/s] at which a force may come down while the gate is closed, 0 to 1e6 */
};

/* What a tick asks for, and what the gate needs to judge it. Vectors in the device's frame. */
struct palpate_gate_wish {
  double t; /* [s] now, on the loop's clock */
  struct palpate_gate_vector force;
  struct palpate_gate_vector torque;
  struct palpate_gate_vector held; /* [N] supports the handle's weight, beside `force` */
  double ring;                     /* [N] length of the part of `force` that is an impact's */
  double frame_age, lost_age;      /* [s] of the oldest camera; from lost_age on it is stale */
  double frame_intervals, late_intervals; /* without a frame; over late_intervals it is late */
  struct palpate_gate_bounds force_bounds, torque_bounds;
  double ramp_time;    /* [s] from no force to the limit, 1e-3 to 1000 */
  double longest_gap;  /* [s] between two ticks, 1e-3 to 1; over it the clock has jumped */
  double longest_time; /* [s] for which a tick may add at most, up to 0.1 */
  int engaged, hand, latched;
  int may_hold; /* the weight may be supported */
};

/* What is remembered of a force or a torque. */
struct palpate_gate_channel {
  struct palpate_gate_vector last; /* sent in the tick before */
  double size;                     /* length of `last`, never more; of late ticks the least */
  double ring;                     /* as the wish's, of the tick before: 0 to 1 */
  double rest;    /* left of a force that was there when the gate closed; it only falls */
  double ceiling; /* the limit; one that was lowered is reached by `fall` */
  double kept;    /* share of the `last` before that is in this `last`, 0 to 1 */
  int verdict;    /* what the gate did in that tick */
};

/* All that the gate remembers. All zero: a gate that has seen no tick. */
struct palpate_gate {
  struct palpate_gate_channel force, torque;
  struct palpate_gate_vector held; /* [N] sent in the tick before, or nothing */
  struct palpate_gate_vector sum;  /* [N] force.last and held: what may be written */
  double t;                        /* [s] of the last tick whose time was a number */
  double share;                    /* [-] of the limit that the ramp has reached */
  double held_share;               /* [-] the same of the weight's support */
  int started;                     /* is there a `t`? */
};

/* What the gate did: bits of the result of palpate_gate_step. */
enum {
  palpate_gate_cut = 1,     /* a vector was longer, or had changed more, than is allowed */
  palpate_gate_shut = 2,    /* all is zero: the clock stood or jumped, or a number was none */
  palpate_gate_refused = 4, /* the result broke a bound itself and is zero; never seen */
};

/* Judges one tick: then `sum` and `torque.last` may be written. [servo] */
int palpate_gate_step(struct palpate_gate* gate, const struct palpate_gate_wish* wish);

#ifdef __cplusplus
}
#endif

#endif
