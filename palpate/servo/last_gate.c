/* SPDX-License-Identifier: Apache-2.0 */
#include "palpate/servo/last_gate.h"

#ifdef __FRAMAC__ /* whatever a square root gives: no proof relies on it */
/*@ assigns \nothing; */
double sqrt(double x);
/*@ assigns \nothing; ensures \result == (x < 0 ? -x : x); */
double fabs(double x);
#define INLINE static
#else
#include <math.h>
/* Structs by value are the easiest to prove; inlined, they are not copied: half of a tick's time.
 */
#define INLINE static inline __attribute__((always_inline))
#endif
#define SELDOM(condition) __builtin_expect(condition, 0)

typedef struct palpate_gate_vector Vector;
typedef struct palpate_gate_bounds Bounds;
typedef struct palpate_gate_channel Channel;
typedef struct palpate_gate_wish Wish;

#define LARGEST 1e6         /* [N], [N m], [N/s], [s]: no number that means anything is larger */
#define LARGEST_TIME 1e12   /* [s] */
#define LARGEST_LIMIT 1e3   /* [N], [N m] */
#define LARGEST_REST 2000.0 /* [N]: twice that limit */
#define SHORTEST 1e-7 /* [s] between two ticks; a tick alone takes longer, so the clock stands */
#define CLOSE_RATE \
  100.0               /* [1/s] a closed gate takes its limit off in 10 ms, as the watchdog does */
#define TICK_MIN 1e-4 /* [s], [s]: for so long a tick takes off, however short or late it is */
#define TICK_MAX 1e-3
#define MOST_RING 1.0 /* [N] as TransientBudget::largest */
#define MOST_HELD 1.0 /* [N] as WeightSupport::most */
#define HELD_TIME 1.5 /* [s] as WeightSupport::ramp_time */
/* A force within WIDEN and GRAIN of a bound passes as it is: the stages before round, too. One that
   is over is scaled to SHRINK of the bound, so that its rounded length is below. */
#define WIDEN (1.0 + 1e-6)
#define GRAIN 1e-9 /* [N] */
#define SHRINK (1.0 - 1e-12)
#define ROUNDED (1.0 + 1e-12) /* by which a square root squared may be more */

static const Vector nothing = {0.0, 0.0, 0.0};

/* What a tick allows to force and torque alike. */
typedef struct {
  double share;     /* [-] of the limit, by the ramp; 0: the gate is closed */
  double add_time;  /* [s] for which it may add */
  double fall_time; /* [s] for which it takes off while the gate is closed */
  double ring;      /* [N] */
  int late;
} Tick;

/*@ predicate sound(Vector v) = -LARGEST <= v.x <= LARGEST && -LARGEST <= v.y <= LARGEST &&
      -LARGEST <= v.z <= LARGEST;
    logic real square(Vector v) = v.x * v.x + v.y * v.y + v.z * v.z;
    predicate zero(Vector v) = v.x == 0 && v.y == 0 && v.z == 0;
    predicate no_longer(Vector v, real bound) = sound(v) && square(v) <= bound * bound;
    logic real turn_square(Vector v, real kept, Vector last) =
      (v.x - kept * last.x) * (v.x - kept * last.x) + (v.y - kept * last.y) * (v.y - kept * last.y)
      + (v.z - kept * last.z) * (v.z - kept * last.z);
    predicate turned(Vector v, real kept, Vector last, real bound) =
      turn_square(v, kept, last) <= bound * bound;
    predicate good_bounds(Bounds b) = 0 <= b.limit <= LARGEST_LIMIT && 0 <= b.rise <= LARGEST &&
      0 <= b.fall <= LARGEST;
    predicate good_channel(Channel c) = sound(c.last) && 0 <= c.size <= 2 * LARGEST_LIMIT &&
      c.size * c.size <= square(c.last) * ROUNDED && 0 <= c.ring <= MOST_RING && 0 <= c.rest <=
   LARGEST_REST && 0 <= c.ceiling <= LARGEST_LIMIT && 0 <= c.kept <= 1; predicate good_tick(Tick t)
   = 0 <= t.share <= 1 && 0 <= t.add_time <= 0.1 && TICK_MIN <= t.fall_time <= TICK_MAX && 0 <=
   t.ring <= MOST_RING; predicate good_gate(struct palpate_gate g) = good_channel(g.force) &&
   good_channel(g.torque) && 0 <= g.share <= 1 && 0 <= g.held_share <= 1 && -LARGEST_TIME <= g.t <=
   LARGEST_TIME; logic real greater_of(real a, real b) = a > b ? a : b; logic real lesser_of(real a,
   real b) = a < b ? a : b; logic real widened(real bound) = bound > 0 ? bound * WIDEN + GRAIN : 0;
    logic real fall_step(Bounds b, Tick t) = greater_of(b.fall, b.limit * CLOSE_RATE) * t.fall_time;
    logic real new_ceiling(Channel c, Bounds b, Tick t) =
      greater_of(b.limit, c.ceiling - fall_step(b, t));
    logic real new_rest(Channel c, Bounds b, Tick t) =
      greater_of(0, (t.share > 0 ? c.rest : c.size) - fall_step(b, t));
    logic real top(Channel c, Bounds b, Tick t) = lesser_of(new_ceiling(c, b, t),
      t.share * new_ceiling(c, b, t) + new_rest(c, b, t) + t.ring);
    logic real turn(Channel c, Bounds b, Tick t) = b.rise * t.add_time + c.ring + t.ring;
*/

/*@ assigns \nothing; ensures \result == greater_of(a, b); */
INLINE double greater(double a, double b) { return a > b ? a : b; }
/*@ assigns \nothing; ensures \result == lesser_of(a, b); */
INLINE double lesser(double a, double b) { return a < b ? a : b; }
/*@ assigns \nothing; ensures \result <==> low <= x <= high; */
INLINE int between(double x, double low, double high) { return x >= low && x <= high; }

/*@ assigns \nothing; ensures \result <==> sound(v); */
INLINE int is_sound(Vector v) {
  return fabs(v.x) <= LARGEST && fabs(v.y) <= LARGEST && fabs(v.z) <= LARGEST;
}

/*@ assigns \nothing; ensures \result <==> zero(v); */
INLINE int is_nothing(Vector v) { return v.x == 0.0 && v.y == 0.0 && v.z == 0.0; }

/*@ assigns \nothing; ensures \result == a.x * b.x + a.y * b.y + a.z * b.z; */
INLINE double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/*@ assigns \nothing; ensures \result <==> no_longer(v, bound); */
INLINE int is_within(Vector v, double bound) { return is_sound(v) && dot(v, v) <= bound * bound; }

/*@ assigns \nothing; ensures \result == widened(bound); */
INLINE double widen(double bound) { return bound > 0.0 ? bound * WIDEN + GRAIN : 0.0; }

/*@ assigns \nothing;
    ensures \result.x == k * v.x && \result.y == k * v.y && \result.z == k * v.z; */
INLINE Vector scaled(double k, Vector v) {
  const Vector result = {k * v.x, k * v.y, k * v.z};
  return result;
}

/*@ requires good_bounds(b) && good_tick(t);
    assigns \nothing; ensures 0 <= \result == fall_step(b, t); */
INLINE double step_of(Bounds b, Tick t) {
  return greater(greater(b.fall, b.limit * CLOSE_RATE) * t.fall_time, 0.0);
}

/*@ requires good_channel(c) && good_bounds(b) && good_tick(t);
    assigns \nothing; ensures 0 <= \result <= LARGEST_LIMIT && \result == new_ceiling(c, b, t); */
INLINE double ceiling_of(Channel c, Bounds b, Tick t) {
  return greater(b.limit, c.ceiling - step_of(b, t));
}

/*@ requires good_channel(c) && good_bounds(b) && good_tick(t);
    assigns \nothing; ensures 0 <= \result <= LARGEST_REST && \result == new_rest(c, b, t); */
INLINE double rest_of(Channel c, Bounds b, Tick t) {
  return greater(0.0, (t.share > 0.0 ? c.rest : c.size) - step_of(b, t));
}

/*@ requires good_channel(c) && good_bounds(b) && good_tick(t);
    assigns \nothing; ensures \result == top(c, b, t); */
INLINE double top_of(Channel c, Bounds b, Tick t) {
  const double ceiling = ceiling_of(c, b, t);
  return lesser(ceiling, t.share * ceiling + rest_of(c, b, t) + t.ring);
}

/*@ assigns \nothing; ensures \result == turn(c, b, t); */
INLINE double turn_of(Channel c, Bounds b, Tick t) { return b.rise * t.add_time + c.ring + t.ring; }

/* Square of v - kept * last. */
/*@ assigns \nothing; ensures \result == turn_square(v, kept, last); */
INLINE double changed_by(Vector v, double kept, Vector last) {
  const double x = v.x - kept * last.x;
  const double y = v.y - kept * last.y;
  const double z = v.z - kept * last.z;
  return x * x + y * y + z * z;
}

/* How much of a wish may pass, and how much of the last force is in that. No proof needs this. */
typedef struct {
  double k, kept;
} Guess;
/*@ assigns \nothing; */
INLINE double kept_at(double k, double along, double before) {
  return !(along > 0.0) ? 0.0 : k * along >= before ? 1.0 : k * along / before;
}
/* Of a wish along the last force, times that one's length. */
/*@ assigns \nothing; */
INLINE double along_of(Vector last, Vector wish) {
  return dot(last, last) > 0.0 ? greater(dot(wish, last), 0.0) : 0.0;
}
/*@ assigns \nothing; */
INLINE Guess guess(Channel c, int late, double top, double turn, Vector wish) {
  const double square = dot(wish, wish);
  const double before = dot(c.last, c.last);
  const double along = along_of(c.last, wish);
  double k = 1.0;
  if (!is_within(wish, widen(top))) k = SHRINK * top / sqrt(square);
  if (late && !(square <= before)) k = lesser(k, SHRINK * c.size / sqrt(square));
  if (!(changed_by(wish, kept_at(1.0, along, before), c.last) <= widen(turn) * widen(turn))) {
    /* As far as `turn` beside the last force, or from its end on. */
    double reached = turn / sqrt(along > 0.0 ? square - along * along / before : square);
    if (!(reached * along <= before))
      reached = (along + sqrt(along * along - square * (before - turn * turn))) / square;
    k = lesser(k, SHRINK * reached);
  }
  const Guess g = {k, kept_at(k, along, before)};
  return g;
}

/*@ assigns \nothing;
    ensures limited: \result != 0 ==> no_longer(v, widened(top)) && 0 <= kept <= 1;
    ensures added: \result != 0 ==> turned(v, kept, last, widened(turn));
    ensures late: \result != 0 && late != 0 ==> square(v) <= square(last); */
INLINE int is_allowed(Vector v, double kept, Vector last, int late, double top, double turn) {
  return is_within(v, widen(top)) && between(kept, 0.0, 1.0) &&
         changed_by(v, kept, last) <= widen(turn) * widen(turn) &&
         (!late || dot(v, v) <= dot(last, last));
}

/*@ requires 0 <= most <= 2 * LARGEST_LIMIT; assigns \nothing;
    ensures 0 <= \result <= most && \result * \result <= square(v) * ROUNDED; */
INLINE double size_of(Vector v, double most) {
  const double size = lesser(sqrt(dot(v, v)), most);
  return between(size, 0.0, most) && size * size <= dot(v, v) * ROUNDED ? size : 0.0;
}

/* Lets a force or torque through as far as the tick allows: all of it, or scaled by one number.
   That number is guessed by square roots and quotients; the result is checked against the bounds
   by itself, and is zero if it breaks one. */
/*@ requires good_channel(c) && good_bounds(b) && good_tick(t) && sound(wish);
    assigns \nothing;
    ensures size: 0 <= \result.size <= 2 * LARGEST_LIMIT &&
      \result.size * \result.size <= square(\result.last) * ROUNDED;
    ensures ranges: sound(\result.last) && 0 <= \result.kept <= 1 &&
      0 <= \result.ceiling <= LARGEST_LIMIT;
    ensures limited: no_longer(\result.last, widened(top(c, b, t)));
    ensures added: turned(\result.last, \result.kept, c.last, widened(turn(c, b, t)));
    ensures late: t.late != 0 ==> square(\result.last) <= square(c.last) && \result.size <= c.size;
    ensures ceiling: \result.ceiling == new_ceiling(c, b, t) && \result.ring == t.ring &&
      \result.rest == new_rest(c, b, t); */
INLINE Channel passed(Channel c, Bounds b, Tick t, Vector wish) {
  Channel next = {wish, 0.0, t.ring, rest_of(c, b, t), ceiling_of(c, b, t), 0.0, 0};
  if (is_nothing(wish)) {
    /*@ assert square(next.last) == 0; */
    return next;
  }
  const double top = top_of(c, b, t);
  const double turn = turn_of(c, b, t);
  next.kept = kept_at(1.0, along_of(c.last, wish), dot(c.last, c.last));
  if (!is_allowed(wish, next.kept, c.last, t.late, top, turn)) {
    const Guess g = guess(c, t.late, top, turn, wish);
    next.last = scaled(g.k, wish);
    next.kept = g.kept;
    next.verdict = palpate_gate_cut;
    if (!is_allowed(next.last, next.kept, c.last, t.late, top, turn)) {
      next.last = nothing;
      next.kept = 0.0;
      next.verdict = palpate_gate_refused;
    }
  }
  next.size = size_of(next.last, t.late ? c.size : 2.0 * LARGEST_LIMIT);
  return next;
}

/*@ assigns \nothing; ensures \result <==> good_bounds(b); */
INLINE int is_good(Bounds b) {
  return between(b.limit, 0.0, LARGEST_LIMIT) && between(b.rise, 0.0, LARGEST) &&
         between(b.fall, 0.0, LARGEST);
}

/*@ predicate good_wish(Wish w) = sound(w.force) && sound(w.torque) && sound(w.held) &&
      good_bounds(w.force_bounds) && good_bounds(w.torque_bounds) && 1e-3 <= w.ramp_time <= 1000 &&
      1e-3 <= w.longest_gap <= 1 && 0 <= w.longest_time <= 0.1;
    predicate in_time(struct palpate_gate g, Wish w) = g.started != 0 &&
      -LARGEST_TIME <= w.t <= LARGEST_TIME && SHORTEST <= w.t - g.t <= w.longest_gap;
    predicate shut(struct palpate_gate g, Wish w) = !good_wish(w) || !in_time(g, w);
    predicate open(Wish w) = w.engaged != 0 && w.hand != 0 && w.latched == 0 &&
      w.frame_age <= w.lost_age;
    logic real held_bound(real share) = widened(share * MOST_HELD); */

/*@ assigns \nothing; ensures \result <==> good_wish(w); */
INLINE int is_good_wish(Wish w) {
  return is_sound(w.force) && is_sound(w.torque) && is_sound(w.held) && is_good(w.force_bounds) &&
         is_good(w.torque_bounds) && between(w.ramp_time, 1e-3, 1000.0) &&
         between(w.longest_gap, 1e-3, 1.0) && between(w.longest_time, 0.0, 0.1);
}

/*@ assigns \nothing; */
INLINE double share_within(double bound, Vector v) { return SHRINK * bound / sqrt(dot(v, v)); }

/* What supports the handle's weight: nothing at once, and all of it only after HELD_TIME. */
/*@ requires 0 <= share <= 1 && sound(wish);
    assigns \nothing; ensures no_longer(\result, held_bound(share)); */
INLINE Vector held_within(double share, Vector wish) {
  const double most = share * MOST_HELD;
  if (is_within(wish, widen(most))) return wish;
  const Vector less = scaled(share_within(most, wish), wish);
  return is_within(less, widen(most)) ? less : nothing;
}

/*@ assigns \nothing; ensures \result <==> in_time(g, w); */
INLINE int is_in_time(struct palpate_gate g, Wish w) {
  return g.started && between(w.t, -LARGEST_TIME, LARGEST_TIME) &&
         between(w.t - g.t, SHORTEST, w.longest_gap);
}

/*@ requires b > 0; assigns \nothing; ensures \result == a / b; */
INLINE double ratio(double a, double b) { return a / b; }

/*@ requires 0 <= share <= 1 && 0 <= more; assigns \nothing;
    ensures 0 <= \result <= 1 && \result <= share + more; */
INLINE double raised(double share, double more) { return lesser(1.0, greater(share + more, 0.0)); }

/*@ requires good_gate(g) && good_wish(w) && in_time(g, w);
    assigns \nothing;
    ensures good_tick(\result) && \result.share <= g.share + \result.add_time / w.ramp_time;
    ensures !open(w) ==> \result.share == 0 && \result.ring == 0;
    ensures 0 <= \result.add_time <= w.longest_time;
    ensures \result.late == 0 <==> w.frame_intervals <= w.late_intervals; */
INLINE Tick tick_of(struct palpate_gate g, Wish w) {
  const double since = w.t - g.t;
  const int is_open = w.engaged && w.hand && !w.latched && w.frame_age <= w.lost_age;
  const double add_time = lesser(since, w.longest_time);
  double share = 0.0;
  if (is_open) share = g.share < 1.0 ? raised(g.share, ratio(add_time, w.ramp_time)) : 1.0;
  const Tick tick = {share, add_time, lesser(greater(since, TICK_MIN), TICK_MAX),
                     is_open && w.ring > 0.0 ? lesser(w.ring, MOST_RING) : 0.0,
                     !(w.frame_intervals <= w.late_intervals)};
  return tick;
}

// Hazard: chain-wrong, torque
/*@ requires good_gate(g);
    assigns \nothing;
    ensures good_gate(\result) && sound(\result.sum);
    ensures shut: shut(g, w) ==> zero(\result.sum) && zero(\result.torque.last) &&
      zero(\result.force.last) && zero(\result.held) && \result.share == 0;
    ensures ramp: !open(w) ==> \result.share == 0;
    ensures held: w.may_hold == 0 ==> zero(\result.held);
    ensures sum: zero(\result.held) && \result.sum == \result.force.last ||
      no_longer(\result.held, held_bound(\result.held_share)) &&
      no_longer(\result.sum, widened(\result.force.ceiling)); */
INLINE struct palpate_gate stepped(struct palpate_gate g, Wish w) {
  const int timed = between(w.t, -LARGEST_TIME, LARGEST_TIME);
  struct palpate_gate next = {{nothing, 0.0, 0.0, 0.0, 0.0, 0.0, palpate_gate_shut},
                              {nothing, 0.0, 0.0, 0.0, 0.0, 0.0, palpate_gate_shut},
                              nothing,
                              nothing,
                              timed ? w.t : g.t,
                              0.0,
                              0.0,
                              timed || g.started};
  if (SELDOM(!is_in_time(g, w) || !is_good_wish(w))) return next;

  Tick tick = tick_of(g, w);
  next.share = tick.share;
  if (w.may_hold) next.held_share = raised(g.held_share, ratio(tick.add_time, HELD_TIME));
  next.force = passed(g.force, w.force_bounds, tick, w.force);
  tick.ring = 0.0;
  next.torque = passed(g.torque, w.torque_bounds, tick, w.torque);

  const Vector force = next.force.last;
  next.sum = force;
  if (!w.may_hold) return next;
  const Vector held = held_within(next.held_share, w.held);
  const Vector sum = {force.x + held.x, force.y + held.y, force.z + held.z};
  if (!is_within(sum, widen(next.force.ceiling))) return next;
  next.held = held;
  next.sum = sum;
  return next;
}

/*@ requires \valid(gate) && \valid_read(wish) && \separated(gate, wish) && good_gate(*gate);
    assigns *gate;
    ensures good_gate(*gate); */
int palpate_gate_step(struct palpate_gate* gate, const Wish* wish) {
  *gate = stepped(*gate, *wish);
  return gate->force.verdict | gate->torque.verdict;
}
