// SPDX-License-Identifier: Apache-2.0
// The messages of docs/protocol.md, as the page sees them. All numbers are little-endian.

export type Vec3 = readonly [number, number, number];
/** A unit quaternion: x y z w. */
export type Quat = readonly [number, number, number, number];

const Kind = { frame: 1, ticks: 2, rays: 3, path: 4, tool: 5, hand: 16, shown: 17 } as const;
const Format = { depth: 0, depthWithRays: 1, points: 2 } as const;
const Colours = { none: 0, registered: 1, ownCamera: 2 } as const;

// The numbers of a sample, in the order of the message; `t` as the time before the newest tick.
const SAMPLE = ["t", "force", "penetration", "steps", "tickTime", "relative", "absolute"] as const;
const HAND_BYTES = 32;
const TURNED_HAND_BYTES = 64;
const SHOWN_BYTES = 8;

/** An image in visible light: red, green and blue, row by row. */
export interface Colour {
  width: number;
  height: number;
  rgb: Uint8Array;
  /** of a colour camera of its own; null: pixel for pixel that of the depth, or of the points */
  camera: { intrinsics: Frame["intrinsics"]; cameraFromWorld: Float32Array } | null;
}

/** One capture of a camera: raw depth as it came, or points that have no image. */
export interface Frame {
  kind: "frame";
  camera: number;
  number: number;
  stamp: number; // [s]
  width: number;
  height: number;
  /** [px] fx, fy, cx, cy; pixel centres at whole numbers */
  intrinsics: readonly [number, number, number, number];
  metresPerUnit: number;
  worldFromCamera: Float32Array; // 3 x 4, row by row
  hasRays: boolean; // the pixels' rays come in a message of their own
  depth: Uint16Array | null;
  points: Float32Array | null; // x y z [m, camera], `width` times
  /** three of the points each; null: they are not the corners of a mesh */
  triangles: Uint32Array | null;
  colour: Colour | null;
}

/** The newest tick and what the plots need of those since the message before. */
export interface Ticks {
  kind: "ticks";
  state: number;
  flags: number; // TickFlag and SafetyFlag bits that occurred since the message before
  safety: number;
  t: number; // [s] of the newest tick
  steps: number;
  frame: number;
  hip: Vec3;
  proxy: Vec3;
  normal: Vec3;
  force: Vec3;
  surfaceVelocity: number; // [m/s]
  gain: number; // [-] of the safety chain: 0 disengaged, 1 nothing faded
  askedForce: number; // [N] length of all that is asked for: by the surface and by fixtures
  place: Vec3; // [m] where the surface and forbidden regions keep the hand
  region: number; // [N] length of what forbidden regions ask for
  guidance: number; // [N] likewise, guides and viscous regions
  fixtures: number; // bit i: fixture i of the state gives a force
  orientation: Quat; // world_from_handle
  proxyOrientation: Quat; // of the tool that surfaces keep outside; of a ball that of the handle
  torque: Vec3; // [N m] world: as sent, or, where the device has no motors for it, as it would be
  contacts: Contact[]; // of a tool with a shape
  samples: Sample[];
}

/** A place where a surface pushes a tool. */
export interface Contact {
  at: Vec3; // [m]
  push: Vec3; // [N] on the tool, as far as the safety chain has faded it in
}

/** A few ticks in one: the extremes of what matters. */
export interface Sample {
  t: number; // [s]
  force: number; // [N]
  penetration: number; // [m] depth of the HIP below the surface; 0 above it
  steps: number;
  tickTime: number; // [s] of the servo thread's own time for a tick
  /** [J] given to the hand in this contact, relative to the surface; below 0: taken from it */
  relative: number;
  absolute: number; // [J] the same with the surface's own motion
}

/** Where a distorted lens's pixels look: (x, y) of the ray (x, y, 1), NaN for none. */
export interface Rays {
  kind: "rays";
  camera: number;
  width: number;
  height: number;
  rays: Float32Array;
}

/** The hand that was recorded with a camera's frames: t [s from the first frame], x y z [m]. */
export interface HandPath {
  kind: "path";
  camera: number;
  places: Float32Array;
}

/** The surface of the tool in the hand, in its own frame; without triangles: a ball. */
export interface Tool {
  kind: "tool";
  points: Float32Array; // x y z [m]
  triangles: Uint32Array; // three of the points each
}

export type Message = Frame | Ticks | Rays | HandPath | Tool;

function need(condition: boolean, what: string): asserts condition {
  if (!condition) throw new Error(`message: ${what}`);
}

/** Takes the numbers of a message one after the other, and arrays as they lie there. */
class Reader {
  private at = 0;
  private readonly view: DataView;

  constructor(private readonly buffer: ArrayBuffer) {
    this.view = new DataView(buffer);
  }

  get left(): number {
    return this.buffer.byteLength - this.at;
  }

  skip(bytes: number): number {
    need(bytes <= this.left, "cut short");
    this.at += bytes;
    return this.at - bytes;
  }

  u8 = () => this.view.getUint8(this.skip(1));
  u16 = () => this.view.getUint16(this.skip(2), true);
  u32 = () => this.view.getUint32(this.skip(4), true);
  i32 = () => this.view.getInt32(this.skip(4), true);
  f32 = () => this.view.getFloat32(this.skip(4), true);
  f64 = () => this.view.getFloat64(this.skip(8), true);
  vec3 = (): Vec3 => [this.f32(), this.f32(), this.f32()];
  vec4 = (): Quat => [...this.vec3(), this.f32()];
  bytes = (count: number) => new Uint8Array(this.buffer, this.skip(count), count);
  shorts = (count: number) => new Uint16Array(this.buffer, this.skip(2 * count), count);
  words = (count: number) => new Uint32Array(this.buffer, this.skip(4 * count), count);
  floats = (count: number) => new Float32Array(this.buffer, this.skip(4 * count), count);
}

function decodeFrame(take: Reader): Frame {
  const [camera, format, colours] = [take.u8(), take.u8(), take.u8()];
  need(format <= Format.points, `frame format ${format}`);
  need(colours <= Colours.ownCamera, `colours ${colours}`);
  const isPoints = format === Format.points;
  const frame = {
    kind: "frame" as const,
    camera,
    number: take.u32(),
    stamp: take.f64(),
    width: take.u32(),
    height: take.u32(),
    intrinsics: take.vec4(),
    metresPerUnit: take.f32(),
    worldFromCamera: take.floats(12),
    hasRays: format === Format.depthWithRays,
  };
  const faces = take.u32();
  const seen =
    colours === Colours.ownCamera
      ? {
          width: take.u32(),
          height: take.u32(),
          camera: { intrinsics: take.vec4(), cameraFromWorld: take.floats(12) },
        }
      : { width: frame.width, height: frame.height, camera: null };
  const count = frame.width * frame.height;
  const pixels = colours === Colours.none ? 0 : seen.width * seen.height;
  return {
    ...frame,
    depth: isPoints ? null : take.shorts(count),
    points: isPoints ? take.floats(3 * count) : null,
    triangles: isPoints && faces > 0 ? take.words(3 * faces) : null,
    colour: pixels > 0 ? { ...seen, rgb: take.bytes(3 * pixels) } : null,
  };
}

function decodeTicks(take: Reader): Ticks {
  const [state, count] = [take.u8(), take.u16()];
  const newest = {
    kind: "ticks" as const,
    state,
    flags: take.u32(),
    t: take.f64(),
    safety: take.u32(),
    steps: take.u32(),
    hip: take.vec3(),
    proxy: take.vec3(),
    normal: take.vec3(),
    force: take.vec3(),
    surfaceVelocity: take.f32(),
    frame: take.i32(),
    gain: take.f32(),
    askedForce: take.f32(),
    place: take.vec3(),
    region: take.f32(),
    guidance: take.f32(),
    fixtures: take.u32(),
    orientation: take.vec4(),
    proxyOrientation: take.vec4(),
    torque: take.vec3(),
  };
  const contact = (): Contact => ({ at: take.vec3(), push: take.vec3() });
  const contacts = Array.from({ length: take.u32() }, contact);
  const samples = Array.from({ length: count }, () => {
    const row = SAMPLE.map((name) => [name, take.f32()] as const);
    const sample = Object.fromEntries(row) as unknown as Sample;
    return { ...sample, t: newest.t - sample.t };
  });
  return { ...newest, contacts, samples };
}

function decodeRays(take: Reader): Rays {
  const camera = take.u8();
  take.skip(2);
  const [width, height] = [take.u32(), take.u32()];
  return { kind: "rays", camera, width, height, rays: take.floats(2 * width * height) };
}

function decodePath(take: Reader): HandPath {
  const camera = take.u8();
  take.skip(2);
  return { kind: "path", camera, places: take.floats(4 * take.u32()) };
}

function decodeTool(take: Reader): Tool {
  take.skip(3);
  const [points, triangles] = [take.u32(), take.u32()];
  return { kind: "tool", points: take.floats(3 * points), triangles: take.words(3 * triangles) };
}

const DECODERS: Record<number, (take: Reader) => Message> = {
  [Kind.frame]: decodeFrame,
  [Kind.ticks]: decodeTicks,
  [Kind.rays]: decodeRays,
  [Kind.path]: decodePath,
  [Kind.tool]: decodeTool,
};

/** Takes a binary message apart without copying its payload. Throws if it is malformed. */
export function decode(buffer: ArrayBuffer): Message {
  need(buffer.byteLength > 0, "empty");
  const take = new Reader(buffer);
  const kind = take.u8();
  const decodeRest = DECODERS[kind];
  need(decodeRest !== undefined, `kind ${kind} is not known`);
  const message = decodeRest(take);
  need(take.left === 0, "cut short");
  return message;
}

/** What the page does with the hand: 2 lets go, and it goes to the place without a force. */
export const Grip = { letGo: 0, held: 1, letGoTowards: 2 } as const;
export type Grip = (typeof Grip)[keyof typeof Grip];

/** Where the hand is to be [m, world], and its orientation; null: as it is. */
export function encodeHand(grip: Grip, target: Vec3, turn: Quat | null = null): ArrayBuffer {
  const buffer = new ArrayBuffer(turn ? TURNED_HAND_BYTES : HAND_BYTES);
  const view = new DataView(buffer);
  view.setUint8(0, Kind.hand);
  view.setUint8(1, grip);
  [...target, ...(turn ?? [])].forEach((value, i) => view.setFloat64(8 + 8 * i, value, true));
  return buffer;
}

/** Says that a frame has been drawn: the program sends the next. */
export function encodeShown(camera: number, number: number): ArrayBuffer {
  const buffer = new ArrayBuffer(SHOWN_BYTES);
  const view = new DataView(buffer);
  view.setUint8(0, Kind.shown);
  view.setUint8(1, camera);
  view.setUint32(4, number, true);
  return buffer;
}

/** A row of the program's table of parameters. */
export interface ParameterRow {
  name: string;
  symbol: string;
  unit: string;
  default: number;
  min: number;
  max: number;
  meaning: string;
  source: string;
  /** of a safety limit: where its strict end is; empty: it has none */
  stricter?: "lower" | "higher" | "";
}

/** What the page may do. */
export type Role = "looking" | "holding" | "operating";

/** Sent once, on connecting. */
export interface Hello {
  version: string;
  role: Role;
  /** of a page that the program has opened by itself: what it must know when it comes again */
  operator_token?: string;
  /** the token in the page's address is none that the program knows, and none is needed */
  token?: "unknown";
  methods: { name: string; meaning: string }[];
  tools: string[]; // that can be chosen, as `--tool` reads them
  /** what can be chosen to be touched; none: nothing can */
  scenes: { uri: string; meaning: string; group: string }[];
  file_limit: number; // [bytes] of the files that the operator's page may send; 0: it may send none
  splat: boolean; // is what is touched a splat, whose Gaussians can be asked for?
  notice: string; // to be shown on joining, such as why a scene could not be opened; empty: nothing
  parameters: ParameterRow[];
  safety: ParameterRow[];
  placement: ParameterRow[]; // where the device's workspace lies in the scene
  /** names of the bits, in their order */
  flags: { name: string; meaning: string }[];
  safety_flags: { name: string; meaning: string }[];
}

export interface CameraState {
  uri: string;
  kind: string;
  sensor: string; // "unknown", "stereo", "structured light", "time of flight"
  rate: number; // [Hz] as captured, lately
  state: string; // live, ended, or what went wrong
  /** what is shown is declared valid until it is replaced: no live camera that stopped */
  stays_valid: boolean;
  dropped: number; // frames that were not handed over, so as to keep up
  frames: number; // of a recording; 0: it has no end, or is none
  place: number; // number of the frame shown last
  time: number; // [s] of that frame, from the first one
}

/** What went through the device, relative to the surface or with the surface's own motion. */
export interface PortEnergy {
  made: number; // [J]
  generating: number; // contacts that made more than 0.1 mJ
}

/** How recordings are played. */
export interface Playback {
  paused: boolean;
  loop: boolean;
  speed: number;
}

/** A robot that the hand leads; 30 times a second. */
export interface RobotState {
  name: string;
  /** [m] world: the middle of the ball at its tip; null: it has not been heard yet */
  tool: Vec3 | null;
  links: Vec3[]; // [m] world: the arm from base to tip; may be empty
  force: Vec3; // [N] of what it touches, on the tool
  radius: number; // [m]
  age: number; // [s] since it said so
  latency: number; // [s] of what is felt, capture to arrival; 0: not known
  led: boolean;
  trouble: string; // why it does not move; empty: nothing is wrong
}

/** A hand beside the first; 30 times a second. */
export interface OtherHand {
  name: string;
  hip: Vec3; // [m] world
  proxy: Vec3; // [m] world
  force: Vec3; // [N] world: as sent
  touches: boolean;
  present: boolean; // somebody holds its device
  trouble: string; // why its device gives no force; empty: it does
}

/** A virtual fixture, as far as it is drawn. */
export interface FixtureState {
  name: string;
  kind: "forbidden" | "guide" | "viscous";
  shape:
    | "box"
    | "sphere"
    | "cylinder"
    | "capsule"
    | "half_space"
    | "mesh"
    | "seen"
    | "path"
    | "plane"
    | "point";
  pose: number[]; // world_from_fixture, 3 x 4, row by row
  size: Vec3; // [m], of a mesh that of its box
  radius: number;
  length: number;
  points: Vec3[];
}

/** Sent a few times a second. */
export interface State {
  role: Role;
  method: string;
  tool: string; // `ball`, or one with a shape
  parameters: Record<string, number>; // values of the rows, by name
  safety: Record<string, number>;
  placement: Record<string, number>;
  cameras: CameraState[];
  playback: Playback | null; // null: nothing is a recording
  /**
   * the first camera's points without an image: how long all is and how far apart they are [m],
   * by what their lengths are best multiplied, and the scene that is so long (empty: nobody is
   * asked); null: none are there
   */
  points: { extent: number; spacing: number; scale: number; rescaled: string } | null;
  /** `warnings`: what speaks against the present stiffness on it */
  device: { uri: string; kind: string; takes_hand: boolean; fault: string; warnings: string[] };
  servo: {
    rate: number; // [Hz]
    realtime: string;
    ticks: number;
    late_ticks: number;
    compute_p99: number; // [s]
    wake_up_p99: number;
    frames_adopted: number;
    frames_dropped: number;
  };
  interventions: number[]; // how often each safety flag was raised
  /** names of the faults that latched: no force until the operator resets them; empty: none did */
  latched_by: string[];
  on_hold: boolean; // the operator keeps the force off
  flag_ticks: number[]; // how many ticks had each flag
  pop_throughs: number;
  /** that the forces sent have given to the hand, in all contacts */
  energy: { contacts: number; relative: PortEnergy; absolute: PortEnergy };
  fixtures: FixtureState[];
  /** what is painted on the cameras' frames */
  paint: {
    /** what is touched is painted with; "" wipes; null: nothing is painted */
    brush: { material: string; radius: number } | null;
    dabs: { place: Vec3; normal: Vec3; radius: number; material: string }[];
    materials: string[]; // that can be painted with
    trouble: string; // why the brush does not paint; empty: it does
  };
  recording: {
    path: string | null;
    message: string;
    ended: string; // why the last was ended by its limits; empty: it was not
    seconds: number; // [s] and [bytes] of the one that is on, or else of the last
    bytes: number;
    /** [bytes] until the limit or the disk's free space ends it; null: not known */
    room: number | null;
    open: string | null; // the last one as a scene; null: there is none that is whole
  };
}

/** What the page can ask for in words. */
export type Command =
  | { set: { name: string; value: number } }
  | { set_safety: { name: string; value: number } }
  | { place: { name: string; value: number } }
  | { method: string }
  | { tool: string }
  | { record: boolean }
  | { play: Playback }
  | { seek: number }
  | { open: string }
  | { rescale: number }
  | { reset: true }
  | { brush: { material: string; radius: number } | null }
  | { clear_paint: true }
  | { forbid: { size: number; margin: number } }
  | { guide: { slack: number } }
  | { remove_fixture: string }
  | { reset_faults: true };
