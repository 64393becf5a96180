# SPDX-License-Identifier: Apache-2.0
# A length that the processor finds within a bound, dot(v, v) <= bound * bound, is within
# bound * (1 + 1e-15): how far both squares may be rounded, for numbers up to the gate's largest.
@rnd = float<ieee_64, ne>;
x = rnd(x_);
y = rnd(y_);
z = rnd(z_);
bound = rnd(bound_);
square rnd= x * x + y * y + z * z;
exact = x * x + y * y + z * z;
most rnd= bound * bound;
{ |x| in [1b-400, 1e6] /\ |y| in [1b-400, 1e6] /\ |z| in [1b-400, 1e6] /\
  bound in [1e-9, 1e6] ->
  square -/ exact in [-4b-53, 4b-53] /\ most -/ (bound * bound) in [-1b-53, 1b-53] }
