// SPDX-License-Identifier: Apache-2.0
// Presses 4 mm into a simulated plane, as a depth camera sees it, and prints the force.
import { Session } from "palpate";

const session = await Session.open("synthetic:plane?size=160x120");
let tick = session.advance(0.1); // the camera's first frame
const [x, y, above] = tick.proxy; // [m] where the hand begins; the plane is at z = 0
for (let ms = 101; ms < 3000; ++ms) {
  session.hand([x, y, Math.max(-0.004, above - 2e-5 * (ms - 101))]);
  tick = session.advance(ms / 1000);
}
console.log(`force ${tick.force.map((f) => f.toFixed(2)).join(" ")} N, state ${tick.state}`);
