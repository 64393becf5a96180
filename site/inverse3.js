// SPDX-License-Identifier: Apache-2.0
// Haply's Inverse Service as the hand of the page, by its WebSocket: it answers each message with
// one state, and each state is answered by a force. A page has no guard that outlives it, so the
// force is at most what the safety chain engages a hand with, and zero unless the page says again
// and again that it is seen.
/* global palpateCall, palpatePost, palpateSeconds, palpateSend, palpateTick */

const INVERSE3_MOST = 0.2; // [N]
const INVERSE3_SILENCE = 0.3; // [s] without a word of the page, after which the force is zero
// forces that the device did not show, after which the service's other word is tried
const INVERSE3_UNHEARD = 100;

const palpateInverse3 = {
  socket: null,
  axes: null, // [-] of the device in the world, as three vectors
  begin: null, // [m] place of the hand in the world, and of the handle, when it was taken
  device: "",
  word: "values",
  unheard: 0,
  heard: -1, // [s] when the page spoke last

  /** @param lead  the service's address and the device's axes in the world; null: let go */
  lead(lead) {
    this.heard = lead ? palpateSeconds() : -1;
    if (!lead) return this.end();
    if (this.socket) return;
    this.axes = lead.axes;
    this.begin = null;
    const socket = (this.socket = new WebSocket(lead.address));
    socket.onmessage = (event) => this.answer(JSON.parse(event.data));
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.end();
      palpateSend({ inverse3: null }, []);
      const why =
        `${lead.address}: no Inverse Service answers; start it, ` +
        "and allow this page to reach it";
      palpatePost(JSON.stringify({ error: why }));
    };
  },

  end() {
    const socket = this.socket;
    if (!socket) return;
    this.send([0, 0, 0]);
    this.socket = null;
    socket.close();
    palpateCall("palpate_hand", ["number", "number", "number", "number"], 0, 0, 0, 0);
  },

  send(vector) {
    if (!this.socket || this.socket.readyState !== 1 || !this.device) return;
    const force = {};
    force[this.word] = { x: vector[0], y: vector[1], z: vector[2] };
    const commands = { set_cursor_force: force };
    this.socket.send(JSON.stringify({ inverse3: [{ device_id: this.device, commands }] }));
  },

  /** To a state of the device: where the hand is, a tick, and its force. */
  answer(message) {
    const device = (message.inverse3 || [])[0];
    if (!device) return;
    this.device = device.device_id;
    const place = Object.assign({ x: 0, y: 0, z: 0 }, (device.state || {}).cursor_position);
    const handle = [place.x, place.y, place.z];
    const now = palpateSeconds();
    const seen = now - this.heard <= INVERSE3_SILENCE;
    const axes = this.axes;
    if (!this.begin) this.begin = { handle, hand: palpateTick().proxy };
    const away = handle.map((x, i) => x - this.begin.handle[i]);
    const to = this.begin.hand.map(
      (x, i) => x + axes[0][i] * away[0] + axes[1][i] * away[1] + axes[2][i] * away[2],
    );
    const types = ["number", "number", "number", "number"];
    palpateCall("palpate_hand", types, seen ? 1 : 0, to[0], to[1], to[2]);
    palpateCall("palpate_advance", ["number"], now);
    const force = palpateTick().force;
    const asked = axes.map((axis) => axis[0] * force[0] + axis[1] * force[1] + axis[2] * force[2]);
    const size = Math.hypot(asked[0], asked[1], asked[2]);
    const share = seen && size > 0 ? Math.min(1, INVERSE3_MOST / size) : 0;
    const sent = Object.assign({ x: 0, y: 0, z: 0 }, (device.state || {}).current_cursor_force);
    const felt = Math.hypot(sent.x, sent.y, sent.z);
    this.unheard = share * size > 0.05 && felt === 0 ? this.unheard + 1 : 0;
    if (this.unheard === INVERSE3_UNHEARD) this.word = "vector";
    this.send(asked.map((x) => share * x));
  },
};
