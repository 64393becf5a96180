// SPDX-License-Identifier: Apache-2.0
import "./style.css";
import { Brush, dabColour } from "./brush";
import { Connection, unknownToken } from "./connection";
import type { Presence } from "./dispatch";
import { get, say, write } from "./dom";
import { takeFiles } from "./files";
import { fixtureLines, Fixtures } from "./fixtures";
import { stickOf } from "./gamepad";
import { HandInput, isForForm } from "./hand";
import { length } from "./camera_math";
import { handsLines, handsText, robotLines, robotText } from "./others";
import { cameraText, latchedText, mayOperate, Panel, roleNames } from "./panel";
import { Plots } from "./plots";
import { radiusRemark, scaleQuestion } from "./proposal";
import {
  encodeHand, encodeShown, type Command, type Frame, type Hello, type State, type Ticks,
} from "./protocol";
import { Ruler } from "./ruler";
import { COLOURS, GHOST_TRAIL, SceneView, type Palette } from "./scene";
import { Senses } from "./senses";
import { linked, linkTo } from "./share";
import { handAt, longest, Timeline, trailAt } from "./timeline";
import { contactRadius, flagNames, SteadyWhy, why } from "./why";

const DISENGAGED = 1 << 6; // SafetyFlag
const PLOT_SHARE = 12; // drawings of the scene for one of the plots, where drawing is slow
const LONGEST_STEP = 50; // [ms] of a gamepad's stick, where drawing is slow
const NUMBERS = 100; // [ms] between changes of what is written: faster, nobody reads it

const plots = new Plots(get("plots"));
let state: State | null = null;
let introduced: Hello | null = null;
let whose: Presence["hand"] = "free";
const senses = new Senses();
const steadyWhy = new SteadyWhy();
let tick: Ticks | null = null;
let announced = "";
let declined = ""; // scene at another size that was not wanted
let remarked = "";
let recordedHand: Float32Array | null = null;
const arrived = new Map<number, Frame>();

function toast(text: string, lasts = 6000): void {
  const box = get("toast");
  box.textContent = text;
  box.hidden = false;
  clearTimeout(Number(box.dataset.timer));
  box.dataset.timer = String(lasts > 0 ? setTimeout(() => (box.hidden = true), lasts) : 0);
}

function makeView(): SceneView {
  try {
    return new SceneView(get<HTMLCanvasElement>("view"));
  } catch (error) {
    toast(`The scene cannot be drawn: ${(error as Error).message}.`, 0);
    throw error;
  }
}
const view = makeView();

// What lies over the scene leaves the rest of the window to it.
function findRoom(): void {
  const box = (selector: string) => document.querySelector(selector)!.getBoundingClientRect();
  const { width, height } = box("#view");
  const panel = box("#panel");
  const numbers = box(".hud");
  view.setRoom({
    width,
    height,
    left: 0,
    top: Math.max(box(".bar").bottom, numbers.width > 0.7 * width ? numbers.bottom : 0),
    right: panel.left > 0.3 * width ? Math.min(width, panel.left) : width,
    bottom: height,
  });
}
for (const id of ["view", "panel"]) new ResizeObserver(findRoom).observe(get(id));
findRoom();

const ask = (command: Command) => connection.ask(command);
const panel = new Panel(ask);
const brush = new Brush(ask);
const fixtures = new Fixtures(ask);
const timeline = new Timeline(ask);
const ruler = new Ruler(get<HTMLCanvasElement>("view"), view, ask);

// What is felt of a splat is a window about the hand; all of it is drawn once it is here.
async function drawSplat(of: Hello): Promise<void> {
  get("felt").hidden = true;
  if (!of.splat) return;
  try {
    const gaussians = await connection.splat();
    if (introduced !== of) return; // another session has begun
    view.showSplat(new Float32Array(gaussians));
    get("felt").hidden = false;
    get("felt").setAttribute("aria-pressed", "false");
  } catch (error) {
    toast(`Only what is felt of the splat is drawn: ${(error as Error).message}.`, 15_000);
  }
}
function switchFelt(): void {
  if (get("felt").hidden) return;
  view.showFelt(!view.showsFelt);
  get("felt").setAttribute("aria-pressed", String(view.showsFelt));
}

const connection = new Connection({
  opened() {
    get("connection").dataset.state = "live";
    write("connection", "connected");
    get("toast").hidden = true;
  },
  lost(refusal) {
    arrived.clear();
    hand.letGo();
    get("connection").dataset.state = "lost";
    write("connection", refusal ? "refused" : "reconnecting");
    toast(
      refusal ?? "The connection to the program is lost. The hand is released; trying again.",
      0,
    );
  },
  hello(hello) {
    if (introduced) view.clear();
    recordedHand = null;
    introduced = hello;
    if (hello.notice) toast(hello.notice, 15_000);
    remarked = "";
    panel.introduce(hello);
    void drawSplat(hello);
    if (hello.token === "unknown") toast(unknownToken, 15_000);
  },
  state(newest) {
    const { ended } = newest.recording;
    if (ended && ended !== state?.recording.ended) toast(ended, 0);
    state = newest;
    const role = get("role");
    role.dataset.role = newest.role;
    role.textContent = roleNames[newest.role].name;
    role.title = roleNames[newest.role].may;
    panel.update(newest, view.inOwnFrame);
    brush.update(newest);
    fixtures.update(newest);
    ruler.update(newest);
    view.showFixtures(newest.fixtures.map((one) => ({ name: one.name, ends: fixtureLines(one) })));
    const { dabs, materials } = newest.paint;
    view.showPaint(
      dabs.map(({ place, normal, radius, material }) => ({
        at: place,
        normal,
        radius,
        colour: dabColour(material, materials),
      })),
    );
    timeline.show(newest, performance.now());
    goToMoment(newest);
    const { r_c, r_1, r_3 } = newest.parameters;
    view.setRadii({ r_c: r_c ?? 0.005, r_1: r_1 ?? 0.005, r_3: r_3 ?? 0.01 });
    write("camera", cameraText(newest));
    get("camera").title = newest.cameras.map(({ uri }) => uri).join(", ");
    write("proposal-text", scaleQuestion(newest.points));
    const proposed = newest.points?.rescaled ?? "";
    get("proposal").hidden = !proposed || proposed === declined || !mayOperate(newest);
    const usual = introduced?.parameters.find(({ name }) => name === "r_c")?.default ?? 0.005;
    const remark = radiusRemark(newest.points, r_c ?? usual, usual);
    if (remark && !remarked) toast((remarked = remark), 10_000);
    const latched = latchedText(newest);
    write("latched-text", latched);
    get("latched").hidden = !latched;
    get("reset-faults").hidden = !mayOperate(newest);
    const record = get<HTMLButtonElement>("record");
    record.disabled = !mayOperate(newest);
    const { path, message } = newest.recording;
    const about = path ? `Recording ${path}; press to end (R)` : message || "Record (R)";
    record.title = mayOperate(newest)
      ? about
      : `${path ? `Recording ${path}. ` : ""}Only the operator's page starts and ends recordings.`;
    record.setAttribute("aria-pressed", String(path !== null));
  },
  presence({ hand: owner, viewers }) {
    whose = owner;
    const chip = get("hand");
    chip.dataset.state = owner;
    const texts = {
      you: "you have the hand",
      other: "another page has the hand",
      free: "hand free",
    };
    chip.textContent = texts[owner] + (viewers > 1 ? ` · ${viewers} viewers` : "");
  },
  more_hands(hands) {
    view.showHands(hands, handsLines(hands));
    say("more-hands", handsText(hands));
  },
  robot(robot) {
    view.showRobot(robot.tool, robot.radius, robot.links, robotLines(robot));
    say("robot", robotText(robot));
  },
  error(reason) {
    toast(reason);
    panel.refused();
  },
  notice: (text) => toast(text, 30_000),
  orbit: () => view.orbit,
  message(message) {
    if (message.kind === "frame") arrived.set(message.camera, message);
    else if (message.kind === "rays") view.setRays(message);
    else if (message.kind === "path") recordedHand = message.places;
    else if (message.kind === "tool") view.showTool(message);
    else {
      tick = message;
      plots.add(message.samples);
      senses.take(message, performance.now());
      view.showTick(message);
      view.showActing(message.fixtures);
    }
  },
});

takeFiles({
  send: (file, name) => connection.sendFile(file, name, toast),
  toast,
  hello: () => introduced,
  state: () => state,
});

const hand = new HandInput(get<HTMLCanvasElement>("view"), view, {
  newest: () =>
    tick && { ...tick, touching: tick.state !== 0, engaged: (tick.safety & DISENGAGED) === 0 },
  takesHand: () => state?.device.takes_hand ?? false,
  touch: () => ({
    r_c: contactRadius(state),
    stiffness: state?.parameters.stiffness ?? 600,
    reach: view.reach,
  }),
  moved(grip, target, turn) {
    connection.send(encodeHand(grip, target, turn));
    get("hint").classList.add("gone");
  },
});

// What the page's link asks for, once it is there.
const asked = linked(location.search);
function goToMoment({ cameras, playback }: State): void {
  const recording = longest(cameras);
  if (asked.frame === null || !recording || !playback) return;
  ask({ seek: Math.min(1, asked.frame / (recording.frames - 1)) });
  ask({ play: { ...playback, paused: true } });
  asked.frame = null;
}
function share(): void {
  const frame = state?.playback ? (longest(state.cameras)?.place ?? null) : null;
  const link = linkTo(location.href, view.orbit, frame);
  history.replaceState(null, "", link);
  const copied = navigator.clipboard?.writeText(link) ?? Promise.reject(new Error());
  copied.then(
    () => toast("The link to this view is copied."),
    () => toast("The link to this view is the page's address."),
  );
}

// All that is said of the force comes from one tick, and changes at once.
let written = 0; // [ms]
function showTick(now: number): void {
  if (now - written < NUMBERS) return;
  written = now;
  const flags = new Set([
    ...flagNames(tick?.flags ?? 0, introduced?.flags ?? []),
    ...flagNames(tick?.safety ?? 0, introduced?.safety_flags ?? []),
    ...(state?.on_hold ? ["on_hold"] : []),
  ]);
  const { connected } = connection;
  const acting = flagNames(tick?.fixtures ?? 0, state?.fixtures ?? []);
  const [clearance, spacing] = [view.clearance(), view.spacing()];
  const facts = { connected, tick, flags, hand: whose, state, acting, clearance, spacing };
  const { word, detail, text, link } = steadyWhy.show(why(facts), now);
  write("force", connected && tick ? length(tick.force).toFixed(2) : "–");
  const turns = tick && state && state.tool !== "ball" ? length(tick.torque) : null;
  write("torque", turns === null ? "" : `${(1e3 * turns).toFixed(0)} mN m`);
  get("spin").hidden = view.reach === 0;
  write("state", word);
  get("state").dataset.state = String(tick?.state ?? 0);
  write("detail", detail);
  write("why-text", text);
  write("why-link", link);
  if (!tick) return;
  panel.showSafety(tick.safety, now);
  const said = tick.state === 0 ? "free" : "touching";
  if (said !== announced) write("announce", (announced = said));
  const range = view.depthRange();
  document.body.dataset.drawn = view.showsColour ? "colour" : "depth";
  get("colour").hidden = !view.hasColour;
  get("colour").setAttribute("aria-pressed", String(view.showsColour));
  if (range) {
    write("legend-near", `${range[0].toFixed(2)} m`);
    write("legend-far", `${range[1].toFixed(2)} m`);
  }
}

let looped = 0; // [ms]
function loop(now: number): void {
  for (const [camera, frame] of arrived) {
    view.showFrame(frame);
    connection.send(encodeShown(camera, frame.number));
  }
  arrived.clear();
  if (asked.orbit && view.frames > 0) {
    view.setOrbit(asked.orbit);
    asked.orbit = null;
  }
  const stick = document.hidden ? null : stickOf(navigator.getGamepads?.() ?? []);
  if (stick) hand.steer(stick, Math.min(now - looped, LONGEST_STEP) / 1000);
  looped = now;
  hand.showPointer();
  const time = recordedHand && timeline.timeNow(now);
  if (recordedHand && time !== null)
    view.showGhost(handAt(recordedHand, time), trailAt(recordedHand, time, 1.2, GHOST_TRAIL - 1));
  else view.showGhost(null);
  view.draw(now);
  senses.give(performance.now());
  showTick(now);
  plots.draw(now, PLOT_SHARE * 1000 * (view.thinning.frameTime ?? 0));
  requestAnimationFrame(loop);
}

function record(): void {
  if (state && mayOperate(state))
    ask({ record: state.recording.path === null });
}
function help(): void {
  const dialog = get<HTMLDialogElement>("help");
  hand.letGo();
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
}

function applyTheme(theme: string): void {
  document.documentElement.dataset.theme = theme;
  const style = getComputedStyle(document.documentElement);
  const colours = COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]);
  view.setPalette(Object.fromEntries(colours) as Palette);
  plots.recolour();
}
const systemTheme = matchMedia("(prefers-color-scheme: light)");
const chosenTheme = () => localStorage.getItem("theme") ?? (systemTheme.matches ? "light" : "dark");
function switchTheme(): void {
  localStorage.setItem("theme", chosenTheme() === "light" ? "dark" : "light");
  applyTheme(chosenTheme());
}
systemTheme.addEventListener("change", () => applyTheme(chosenTheme()));
applyTheme(chosenTheme());

// A button that is on or off.
const toggled = (id: string, set: (on: boolean) => void) => (): void => {
  const on = get(id).getAttribute("aria-pressed") !== "true";
  set(on);
  get(id).setAttribute("aria-pressed", String(on));
};
const buttons: Record<string, () => void> = {
  follow: toggled("follow", (on) => view.setFollowing(on)),
  spin: toggled("spin", (on) => (hand.spinByDrags = on)),
  // Off at first: a page makes no noise by itself.
  sound: toggled("sound", (on) => senses.setSound(on)),
  vibration: toggled("vibration", (on) => senses.setVibration(on)),
  "reset-faults": () => ask({ reset_faults: true }),
  "proposal-yes": () => state?.points && ask({ open: state.points.rescaled }),
  "proposal-no": () => {
    declined = state?.points?.rescaled ?? "";
    get("proposal").hidden = true;
  },
  "more-plots": () => {
    const all = get("more-plots").getAttribute("aria-expanded") !== "true";
    get("more-plots").setAttribute("aria-expanded", String(all));
    write("more-plots", all ? "Fewer figures" : "More figures");
    plots.show(all);
  },
  felt: switchFelt,
  colour: () => view.switchTint(),
  reset: () => view.resetView(),
  play: () => timeline.pause(),
  theme: switchTheme,
  ask: help,
  record,
  share,
};
for (const [id, act] of Object.entries(buttons)) get(id).addEventListener("click", act);
const KEYS: Record<string, string> = {
  ...{ KeyF: "follow", KeyC: "colour", KeyS: "felt", KeyV: "reset" },
  ...{ KeyR: "record", KeyT: "theme", KeyK: "play" },
};
for (const [id, share] of [["push", 0.006], ["pull", -0.006]] as const) {
  let timer = 0;
  const button = get(id);
  button.addEventListener("pointerdown", () => {
    timer = window.setInterval(() => hand.push(share), 50);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"])
    button.addEventListener(end, () => clearInterval(timer));
  button.addEventListener("click", () => hand.push(share));
}
addEventListener("keydown", (event) => {
  if (isForForm(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "?") help();
  buttons[KEYS[event.code] ?? ""]?.();
});

requestAnimationFrame(loop);

// For the tests that look at the page from outside.
Object.assign(window, {
  palpate: { view, senses, newest: () => ({ tick, state }), history: () => plots.history() },
});
