/* SPDX-License-Identifier: Apache-2.0 */
/* How long a force can act after one failure: servo ticks with the last gate, watchdog thread, guard
   process and stop, in steps of 1 ms. Whatever the safety chain asks for is possible. Forces are
   tenths of the limit, as a closed gate takes one off per tick. scripts/prove explores all of it.
   Not in it: a camera before its frames are stale (lost_age, 0.5 s by default), a guard process
   that is killed, a device without a guard whose process is killed, the computer as a whole. */
#define FULL 10
#define FORCE_TIME 10  /* [ms] ForceWatchdog::Limits */
#define WATCH_TIME 25
#define BEAT_TIME 20   /* [ms] GuardLimits */
#define LATE 5         /* [ms] SafetyParameters::stall_time; ticks are late by that in all */
#define LONGEST 50     /* [ms] that a force may last */

mtype = { none, hand_lost, disengaged, latched, frames_stale, clock_fails, number_fails,
          method_hangs, driver_hangs, process_killed, process_stopped, stop_asked, stop_of_hanging }

mtype failure = none
bool guarded, looks, disabled, let_go = true, ticks
byte sent, written, shown /* tenths of the limit: by the gate, by the guard, on the hand */
byte gap, late, silence, since
byte most /* that the gate may send */

c_code { static int longest[64]; }

inline fail() {
  if
  :: failure = hand_lost
  :: failure = disengaged
  :: failure = latched
  :: failure = frames_stale
  :: failure = clock_fails
  :: failure = number_fails
  :: failure = method_hangs
  :: failure = driver_hangs
  :: guarded -> failure = process_killed
  :: guarded -> failure = process_stopped
  :: failure = stop_asked
  :: failure = stop_of_hanging
  fi
}

/* One tick of the cycle, if there is one in this step. */
inline servo() {
  ticks = failure != method_hangs && failure != driver_hangs && failure != process_killed &&
          failure != process_stopped && failure != stop_of_hanging
  if
  :: ticks && late < LATE -> ticks = false; late++
  :: true
  fi
  if
  :: !ticks && gap < 100 -> gap++
  :: !ticks && gap >= 100
  :: ticks && (gap > LATE || failure == clock_fails || failure == number_fails ||
               failure == stop_asked) -> sent = 0; gap = 0
  :: ticks && gap <= LATE && (failure == hand_lost || failure == disengaged ||
               failure == latched || failure == frames_stale) ->
       gap = 0
       most = (sent > 0 -> sent - 1 : 0)
       select(sent : 0 .. most)
  :: ticks && gap <= LATE && failure == none -> gap = 0; most = FULL; select(sent : 0 .. most)
  fi
}

/* The thread that looks every 2 ms, in the session's process. */
inline watchdog() {
  looks = !looks
  if
  :: looks && failure != process_killed && failure != process_stopped ->
       if
       :: gap > (sent > 0 -> FORCE_TIME : WATCH_TIME) -> disabled = true
       :: gap <= FORCE_TIME -> disabled = false
       :: else
       fi
  :: else
  fi
  if
  :: failure == stop_asked && ticks -> disabled = true
  :: else
  fi
}

/* The guard writes in this step what it saw in the one before. */
inline guard() {
  shown = ((disabled || (guarded && !let_go)) -> 0 : (guarded -> written : sent))
  if
  :: ticks -> silence = 0; let_go = let_go || sent == 0
  :: !ticks && silence < 100 -> silence++
  :: else
  fi
  if
  :: silence > BEAT_TIME -> let_go = false
  :: else
  fi
  written = sent
}

active proctype session() {
  if
  :: guarded = true
  :: guarded = false
  fi
  if
  :: looks = true
  :: looks = false
  fi
  do
  :: since <= LONGEST + 10 ->
     atomic {
       if
       :: failure == none -> fail()
       :: true
       fi
       servo()
       watchdog()
       guard()
       if
       :: failure != none -> since++
       :: else
       fi
       if
       :: failure != none && shown > 0 ->
            c_code {
              if (now.since > longest[now.failure]) {
                static const char* const names[] = {
                    "stop_of_hanging", "stop_asked", "process_stopped", "process_killed",
                    "driver_hangs", "method_hangs", "number_fails", "clock_fails",
                    "frames_stale", "latched", "disengaged", "hand_lost", "none"};
                longest[now.failure] = now.since;
                printf("force after %s: %d ms\n", names[now.failure - 1], now.since);
              }
            }
            assert(since <= LONGEST)
       :: else
       fi
     }
  :: since > LONGEST + 10 -> break
  od
}
