/* SPDX-License-Identifier: Apache-2.0 */
/* The gate for CBMC: bit by bit, for all numbers (NaN, infinities, denormals), all orders of times
   and all states that good_gate allows. A square root gives any number, NaN included. Run by
   scripts/prove; each function here is a proof of its own. */
double nondet_double(void);
int nondet_int(void);
#include "palpate/servo/last_gate.c"
#include "palpate/servo/last_gate.h"

#define ASSUME(condition) __CPROVER_assume(condition)
#define ASSERT(condition, name) __CPROVER_assert(condition, name)

static Vector any_vector(void) {
  const Vector v = {nondet_double(), nondet_double(), nondet_double()};
  return v;
}
static Bounds any_bounds(void) {
  const Bounds b = {nondet_double(), nondet_double(), nondet_double()};
  return b;
}
static Channel any_channel(void) {
  const Channel c = {any_vector(),    nondet_double(), nondet_double(), nondet_double(),
                     nondet_double(), nondet_double(), nondet_int()};
  return c;
}

static int is_zero(Vector v) { return v.x == 0.0 && v.y == 0.0 && v.z == 0.0; }
static int is_good_channel(Channel c) {
  return is_sound(c.last) && between(c.size, 0.0, 2.0 * LARGEST_LIMIT) &&
         between(c.ring, 0.0, MOST_RING) && between(c.rest, 0.0, LARGEST_REST) &&
         between(c.ceiling, 0.0, LARGEST_LIMIT) && between(c.kept, 0.0, 1.0);
}
static int is_good_tick(Tick t) {
  return between(t.share, 0.0, 1.0) && between(t.add_time, 0.0, 0.1) &&
         between(t.fall_time, TICK_MIN, TICK_MAX) && between(t.ring, 0.0, MOST_RING);
}
/* Products and sums are the processor's, whatever they are: the same of the same numbers. */
double __CPROVER_uninterpreted_dot(double, double, double, double, double, double);
double __CPROVER_uninterpreted_changed(double, double, double, double, double, double, double);
double __CPROVER_uninterpreted_product(double, double);
double same_dot(Vector a, Vector b) {
  return __CPROVER_uninterpreted_dot(a.x, a.y, a.z, b.x, b.y, b.z);
}
double same_changed(Vector v, double kept, Vector last) {
  return __CPROVER_uninterpreted_changed(v.x, v.y, v.z, kept, last.x, last.y, last.z);
}
double same_widen(double bound) { return __CPROVER_uninterpreted_product(bound, WIDEN); }
Vector any_scaled(double k, Vector v) { return any_vector(); }
double any_ratio(double a, double b) { return nondet_double(); }
double any_bound(Channel c, Bounds b, Tick t) { return nondet_double(); }
int same_within(Vector v, double bound) {
  return is_sound(v) && __CPROVER_uninterpreted_dot(v.x, v.y, v.z, v.x, v.y, v.z) <=
                            __CPROVER_uninterpreted_product(bound, bound);
}

/* In place of functions of which the proofs use no more than this; see the goals in goals.txt. */
Guess any_guess(Channel c, int late, double top, double turn, Vector wish) {
  const Guess g = {nondet_double(), nondet_double()};
  return g;
}
double any_share(double bound, Vector v) { return nondet_double(); }
double any_root(double x) { return nondet_double(); }
double any_step(Bounds b, Tick t) {
  const double step = nondet_double();
  ASSUME(step >= 0.0); /* check_step */
  return step;
}
double any_size(Vector v, double most) {
  const double size = nondet_double();
  ASSUME(between(size, 0.0, most)); /* check_size */
  return size;
}
double any_ceiling(Channel c, Bounds b, Tick t) {
  const double ceiling = nondet_double();
  ASSUME(between(ceiling, 0.0, LARGEST_LIMIT)); /* check_falling */
  return ceiling;
}
double any_rest(Channel c, Bounds b, Tick t) {
  const double rest = nondet_double();
  ASSUME(between(rest, 0.0, LARGEST_REST)); /* check_falling */
  return rest;
}
Vector any_held(double share, Vector wish) {
  const Vector held = any_vector();
  ASSUME(is_sound(held)); /* check_held */
  return held;
}
Channel any_passed(Channel c, Bounds b, Tick t, Vector wish) {
  const Channel next = any_channel();
  ASSUME(is_good_channel(next)); /* check_channel, for c and t that are good */
  ASSERT(is_good_channel(c) && is_good(b) && is_good_tick(t), "what check_channel requires");
  return next;
}
static int found_in_time;
int any_in_time(struct palpate_gate g, Wish w) {
  found_in_time = nondet_int();
  ASSUME(!found_in_time || between(w.t, -LARGEST_TIME, LARGEST_TIME)); /* check_time */
  return found_in_time;
}
Tick any_tick(struct palpate_gate g, Wish w) {
  const Tick t = {nondet_double(), nondet_double(), nondet_double(), nondet_double(), nondet_int()};
  ASSUME(is_good_tick(t)); /* check_tick */
  ASSUME((w.engaged && w.hand && !w.latched && w.frame_age <= w.lost_age) || t.share == 0.0);
  ASSERT(is_good_wish(w), "what check_tick requires");
  return t;
}
static struct {
  Vector v, last;
  double kept, top, turn;
  int late, result;
} judged;
int judge(Vector v, double kept, Vector last, int late, double top, double turn) {
  judged.v = v;
  judged.last = last;
  judged.kept = kept;
  judged.top = top;
  judged.turn = turn;
  judged.late = late;
  judged.result = nondet_int();
  ASSUME(!judged.result || (is_sound(v) && between(kept, 0.0, 1.0))); /* check_allowed */
  return judged.result;
}

/* What is_allowed allows keeps every bound, as the processor computes them. */
void check_allowed(void) {
  const Vector v = any_vector();
  const Vector last = any_vector();
  const double kept = nondet_double();
  const double top = nondet_double();
  const double turn = nondet_double();
  const int late = nondet_int();
  ASSUME(is_allowed(v, kept, last, late, top, turn));
  ASSERT(is_sound(v), "finite");
  ASSERT(between(kept, 0.0, 1.0), "kept");
  ASSERT(is_within(v, widen(top)), "limited");
  ASSERT(!late || dot(v, v) <= dot(last, last), "late");
}

/* A force that falls does so by a number that is not negative. */
void check_step(void) {
  const Bounds b = any_bounds();
  const Tick t = {0.0, 0.0, nondet_double(), 0.0, 0};
  ASSUME(is_good(b) && between(t.fall_time, TICK_MIN, TICK_MAX));
  ASSERT(step_of(b, t) >= 0.0, "positive");
}

void check_size(void) {
  const Vector v = any_vector();
  const double most = nondet_double();
  ASSUME(between(most, 0.0, 2.0 * LARGEST_LIMIT));
  const double size = size_of(v, most);
  ASSERT(between(size, 0.0, most), "range");
}

/* A limit that was lowered, and the rest of a force, only fall. */
void check_falling(void) {
  const Channel c = any_channel();
  const Bounds b = any_bounds();
  const Tick t = {nondet_double(), nondet_double(), nondet_double(), nondet_double(), nondet_int()};
  ASSUME(is_good_channel(c) && is_good(b) && is_good_tick(t));
  const double ceiling = ceiling_of(c, b, t);
  ASSERT(ceiling >= b.limit, "limit");
  ASSERT(ceiling <= b.limit || ceiling <= c.ceiling, "ceiling");
  const double rest = rest_of(c, b, t);
  ASSERT(between(rest, 0.0, LARGEST_REST), "range");
  ASSERT(!(t.share > 0.0) || rest <= c.rest, "rest");
  ASSERT(t.share > 0.0 || rest <= c.size, "closed");
}

/* One channel: what it sends is what is_allowed was asked about with the tick's own bounds and has
   allowed, or nothing, as which a wish for nothing passes; and the state keeps its invariant. */
void check_channel(void) {
  const Channel c = any_channel();
  const Bounds b = any_bounds();
  const Tick t = {nondet_double(), nondet_double(), nondet_double(), nondet_double(), nondet_int()};
  const Vector wish = any_vector();
  ASSUME(is_good_channel(c) && is_good(b) && is_good_tick(t));
  const Channel next = passed(c, b, t, wish);
  const Vector v = next.last;
  if (judged.result) {
    ASSERT(v.x == judged.v.x && v.y == judged.v.y && v.z == judged.v.z, "judged");
    ASSERT(next.kept == judged.kept, "kept");
    ASSERT(judged.last.x == c.last.x && judged.last.y == c.last.y && judged.last.z == c.last.z,
           "last");
    ASSERT((judged.late != 0) == (t.late != 0), "judged_late");
  } else {
    ASSERT(is_zero(v) && next.kept == 0.0, "nothing");
    ASSERT(is_zero(wish) || next.verdict == palpate_gate_refused, "refused");
  }
  ASSERT(!t.late || next.size <= c.size, "late_size");
  ASSERT(next.ring == t.ring, "ring");
  ASSERT(is_good_channel(next), "invariant");
}

static struct palpate_gate any_gate(void) {
  const struct palpate_gate g = {any_channel(),   any_channel(),   any_vector(),    any_vector(),
                                 nondet_double(), nondet_double(), nondet_double(), nondet_int()};
  ASSUME(is_good_channel(g.force) && is_good_channel(g.torque) && between(g.share, 0.0, 1.0) &&
         between(g.held_share, 0.0, 1.0) && between(g.t, -LARGEST_TIME, LARGEST_TIME));
  return g;
}
static Wish any_wish(void) {
  const Wish w = {nondet_double(), any_vector(),    any_vector(),    any_vector(),
                  nondet_double(), nondet_double(), nondet_double(), nondet_double(),
                  nondet_double(), any_bounds(),    any_bounds(),    nondet_double(),
                  nondet_double(), nondet_double(), nondet_int(),    nondet_int(),
                  nondet_int(),    nondet_int()};
  return w;
}

/* The times and flags of a tick. */
void check_tick(void) {
  const struct palpate_gate g = any_gate();
  const Wish w = any_wish();
  ASSUME(is_good_wish(w) && between(w.t - g.t, SHORTEST, w.longest_gap));
  const Tick t = tick_of(g, w);
  const int open = w.engaged && w.hand && !w.latched && w.frame_age <= w.lost_age;
  ASSERT(is_good_tick(t), "ranges");
  ASSERT(open || (t.share == 0.0 && t.ring == 0.0), "closed");
  ASSERT(t.add_time <= w.longest_time, "add_time");
  ASSERT(t.share == 0.0 || t.share <= 1.0, "ramp");
  ASSERT((t.late != 0) == !(w.frame_intervals <= w.late_intervals), "late");
}

/* A clock that stands, jumps, runs back or is no number is found. */
void check_time(void) {
  const struct palpate_gate g = any_gate();
  const Wish w = any_wish();
  const int in_time = is_in_time(g, w);
  ASSERT(!in_time || g.started, "started");
  ASSERT(!in_time || between(w.t, -LARGEST_TIME, LARGEST_TIME), "number");
  ASSERT(!in_time || w.t > g.t, "forwards");
  ASSERT(!in_time || w.longest_gap >= SHORTEST, "jump");
}

/* The weight's support. */
void check_held(void) {
  const double share = nondet_double();
  const Vector wish = any_vector();
  ASSUME(between(share, 0.0, 1.0));
  const Vector held = held_within(share, wish);
  ASSERT(is_zero(held) || is_within(held, widen(share * MOST_HELD)), "held");
}

/* A whole tick: zero where the clock or a number is refused, ramps that begin where it is closed,
   and the invariant. */
void check_step_of_gate(void) {
  struct palpate_gate g = any_gate();
  const Wish w = any_wish();
  const int open = w.engaged && w.hand && !w.latched && w.frame_age <= w.lost_age;
  const int verdict = palpate_gate_step(&g, &w);
  if (!found_in_time || !is_good_wish(w)) {
    ASSERT(verdict == palpate_gate_shut, "verdict");
    ASSERT(is_zero(g.sum) && is_zero(g.torque.last), "zero");
    ASSERT(is_zero(g.force.last) && is_zero(g.held), "zero_state");
    ASSERT(g.share == 0.0 && g.held_share == 0.0, "ramps");
  }
  ASSERT(open || g.share == 0.0, "closed");
  ASSERT(w.may_hold || is_zero(g.held), "held");
  ASSERT(is_sound(g.sum) && is_sound(g.torque.last), "finite");
  ASSERT(is_good_channel(g.force) && is_good_channel(g.torque), "channels");
  ASSERT(between(g.share, 0.0, 1.0) && between(g.held_share, 0.0, 1.0), "shares");
  ASSERT(between(g.t, -LARGEST_TIME, LARGEST_TIME), "time");
}
