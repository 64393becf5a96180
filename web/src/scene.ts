// SPDX-License-Identifier: Apache-2.0
// What is drawn: the clouds, the proxy at its true size, the hand, the normal's pin and the force's
// arrow, as in the paper's Figs. 10 and 15; and what says where they are: the hand's shadow, the
// spot under the pointer, the cameras, and a grid below all that is seen.

import * as THREE from "three";
import { CameraCloud, cloudLook } from "./cloud";
import {
  add, axes, clamp, depthOf, dot, eye, FIELD_OF_VIEW, length, lookAt, metresPerPixel, rayThrough,
  scale, sub, unit, type Orbit,
} from "./camera_math";
import { firstView, offCentre, type Room } from "./first_view";
import { cameraLines, floorUnder, gridLines, AXES_LENGTH } from "./marks";
import { nearestAbout, type Place } from "./pointers";
import type { Contact, Frame, OtherHand, Rays, Ticks, Tool, Vec3 } from "./protocol";
import { SplatCloud } from "./splat";
import type { SeenSurface, Spot } from "./surface";
import { SOFTWARE_LEVEL, Thinning } from "./thinning";

const ARROW_PER_NEWTON = 0.055; // of the view's height
const LONGEST_ARROW = 0.4; // likewise
const ARROW_WIDTH = 0.006; // likewise
const CONTACT_WIDTH = 0.004; // likewise: of a contact's arrow
const LEAST_FORCE = 0.01; // [N] that is drawn
const RING_PER_NEWTON_METRE = 0.5; // of the view's height: the torque's radius
const RINGS = [0.04, 0.15] as const; // likewise: least and most
const TOOL_EDGES = 30; // [degrees] between faces that have an edge
const LEAST_TORQUE = 1e-3; // [N m] that is drawn
const PIN = 3.2; // contact radii
const MOST_CONTACTS = 6; // of a tool
const TRAIL = 360; // ticks messages
/** Places of the line behind the recorded hand. */
export const GHOST_TRAIL = 60;
const MOST_DABS = 500; // of paint
const LONGEST_NAME = 24; // letters of a fixture's name in the scene
const MOST_LINKS = 32; // of a robot's arm
const PAINT_LAYER = 5e-3; // [m] before the surface
const RING_WIDTH = 30; // [px] of the ring about the proxy
const SPOT_SIZE = 9; // [px] of the ring under the pointer
const REST = 300; // [ms] without a change, after which the view is drawn finely
const SOFTWARE_INTERVAL = 28; // [ms] at least between drawings where a processor draws

export interface Radii {
  r_c: number;
  r_1: number;
  r_3: number;
}

/** The page's colours that are drawn with, by their names in style.css. */
export const COLOURS = [
  "near", "middle", "far", "force", "hip", "proxy", "calm", "text", "ground", "fixture",
] as const;
export type Palette = Record<(typeof COLOURS)[number], string>;

function ringTexture(): THREE.Texture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const context = canvas.getContext("2d")!;
  context.strokeStyle = "white";
  context.lineWidth = 6;
  context.beginPath();
  context.arc(64, 64, 58, 0, 2 * Math.PI);
  context.stroke();
  return new THREE.CanvasTexture(canvas);
}

// A name that faces the eye and keeps its size on the screen; of a long one its beginning.
function nameSprite(whole: string, colour: string): THREE.Sprite {
  const name = whole.length > LONGEST_NAME ? `${whole.slice(0, LONGEST_NAME - 1)}…` : whole;
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("2d")!;
  const font = "600 44px system-ui, sans-serif";
  context.font = font;
  canvas.width = Math.ceil(context.measureText(name).width) + 8;
  canvas.height = 56;
  context.font = font;
  context.fillStyle = colour;
  context.fillText(name, 4, 44);
  const map = new THREE.CanvasTexture(canvas);
  const sprite = new THREE.Sprite(
    new THREE.SpriteMaterial({ map, depthTest: false, sizeAttenuation: false }),
  );
  const high = 0.022; // of the distance
  sprite.scale.set((high * canvas.width) / canvas.height, high, 1);
  sprite.center.set(0, 0);
  return sprite;
}

const BALL = new THREE.SphereGeometry(1, 48, 32);
const HIDDEN_TOO = { depthTest: false, transparent: true } as const;
const FLAT = { ...HIDDEN_TOO, side: THREE.DoubleSide } as const;

const FAR_AWAY: Vec3 = [0, 0, 1e6]; // a proxy that is not known: nothing glows
const NO_CONTACT: Contact = { at: [0, 0, 0], push: [0, 0, 0] };
const NO_TOOL: Tool = { kind: "tool", points: new Float32Array(), triangles: new Uint32Array() };

// A body that is lit: a ball, unless it has a shape of its own.
type Body = THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial>;
function body(
  look: THREE.MeshStandardMaterialParameters,
  shape: THREE.BufferGeometry = BALL,
): Body {
  return new THREE.Mesh(shape, new THREE.MeshStandardMaterial(look));
}

// A flat mark, which is seen from both sides and through what is before it.
function flat(shape: THREE.BufferGeometry, look: THREE.MeshBasicMaterialParameters) {
  return new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ ...FLAT, ...look }));
}

function line(look: THREE.LineBasicMaterialParameters) {
  return new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial(look));
}

function segments(opacity: number) {
  const material = new THREE.LineBasicMaterial({ transparent: true, opacity });
  return new THREE.LineSegments(new THREE.BufferGeometry(), material);
}

// A cylinder one long that stands on its origin.
function rod(radius: number, sides: number): THREE.CylinderGeometry {
  return new THREE.CylinderGeometry(radius, radius, 1, sides).translate(0, 0.5, 0);
}

// A shaft and a head along y, which `point` stretches.
function arrow(material: THREE.Material): THREE.Group {
  const head = new THREE.ConeGeometry(1, 1, 28).translate(0, 0.5, 0);
  return new THREE.Group().add(...[rod(1, 20), head].map((part) => new THREE.Mesh(part, material)));
}

// Three quarters of a ring about z, with a point: the way that something turns.
function turningArrow(material: THREE.Material): THREE.Group {
  const arc = new THREE.TorusGeometry(1, 0.07, 12, 40, 1.5 * Math.PI);
  const point = new THREE.ConeGeometry(0.22, 0.5, 20).rotateZ(1.5 * Math.PI).translate(0.1, -1, 0);
  return new THREE.Group().add(...[arc, point].map((part) => new THREE.Mesh(part, material)));
}

// Of some, the one of which there is the least; null: there are none.
function leastOf<One>(all: readonly One[], measure: (one: One) => number): One | null {
  const lesser = (a: One | null, b: One) => (a && measure(a) <= measure(b) ? a : b);
  return all.reduce(lesser, null);
}

function isSoftwareRenderer(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}

export class SceneView {
  orbit: Orbit = lookAt([0.2, -0.4, 0.5], [0, 0, 0], [0, 0, 1]);
  readonly thinning: Thinning;
  /** How many frames have been shown. */
  frames = 0;
  /** How many points the last drawing was given, for tests and the session's facts. */
  drawnPoints = 0;
  drawings = 0;

  private readonly software: boolean;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW * THREE.MathUtils.RAD2DEG);
  private readonly look = cloudLook();
  private readonly clouds = new Map<number, CameraCloud>();
  private readonly felt = new THREE.Group(); // all that is drawn of them
  private splat: SplatCloud | null = null;
  private readonly proxy = body({ roughness: 0.35 });
  private readonly ring = new THREE.Sprite(
    new THREE.SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false }),
  );
  private readonly hip = new THREE.Mesh(BALL, new THREE.MeshBasicMaterial({ depthTest: false }));
  private readonly link = line({ depthTest: false });
  private readonly plumb = new THREE.Line(
    new THREE.BufferGeometry(),
    new THREE.LineDashedMaterial({ dashSize: 0.004, gapSize: 0.003 }),
  );
  private readonly ruler = line({ depthTest: false });
  private readonly trail = line({ transparent: true, opacity: 0.7 });
  private readonly shadow = flat(new THREE.CircleGeometry(1, 40), { color: 0, opacity: 0.45 });
  private readonly spot = flat(new THREE.RingGeometry(0.8, 1, 40), { opacity: 0.9 });
  private readonly grid = segments(0.16);
  // Each with its name; those that give a force in another colour.
  private readonly fixtures = new THREE.Group();
  private readonly idle = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.8 });
  private readonly acting = new THREE.LineBasicMaterial();
  private readonly frusta = segments(0.5);
  private readonly paint = new THREE.InstancedMesh(
    new THREE.CircleGeometry(1, 24),
    new THREE.MeshBasicMaterial({ transparent: true, depthWrite: false, opacity: 0.45 }),
    MOST_DABS,
  );
  // The robot that the hand leads.
  private readonly tool = body({ roughness: 0.4 });
  private readonly arm = new THREE.InstancedMesh(
    rod(1, 12),
    new THREE.MeshStandardMaterial({ roughness: 0.6 }),
    MOST_LINKS,
  );
  private readonly push = segments(1);
  // The hands beside the first: proxies and HIPs in turn.
  private readonly otherBalls: Body[] = [];
  private readonly otherLines = segments(1);
  private fixturesDrawn = "";
  private readonly dab = new THREE.Object3D(); // where one of them is
  private readonly axes = new THREE.AxesHelper(AXES_LENGTH);
  // The hand that was recorded, which presses into the surface.
  private readonly ghost = body({ ...HIDDEN_TOO, opacity: 0.6, roughness: 0.8 });
  private readonly ghostTrail = line({ ...HIDDEN_TOO, opacity: 0.6 });
  private readonly pin = body({ roughness: 0.6 }, rod(0.09, 12));
  private readonly arrowMaterial = new THREE.MeshStandardMaterial({ roughness: 0.5 });
  private readonly arrow = arrow(this.arrowMaterial);
  // The tool in the hand, if it has a shape: held off by surfaces, and as the hand holds it.
  private readonly heldTool = body(
    { flatShading: true, roughness: 0.5 },
    new THREE.BufferGeometry(),
  );
  private readonly handTool = new THREE.Mesh(
    this.heldTool.geometry,
    new THREE.MeshBasicMaterial({ ...HIDDEN_TOO, opacity: 0.35 }),
  );
  private readonly handToolEdges = segments(1);
  reach = 0; // [m] of the tool from the hand; 0: it is a ball
  private readonly overlay = new THREE.MeshBasicMaterial({ depthTest: false }); // before the tool
  private readonly turning = turningArrow(this.overlay);
  private readonly contacts = Array.from({ length: MOST_CONTACTS }, () => arrow(this.overlay));
  private readonly lamp = new THREE.DirectionalLight(0xffffff, 2.2);
  private readonly trailPoints: number[] = [];
  private palette!: Palette;
  private radii: Radii = { r_c: 0.005, r_1: 0.00499, r_3: 0.01 };
  private tick: Ticks | null = null;
  private pointedAt: Spot | null = null;
  private under: { spot: Spot; height: number } | null = null; // the hand, when it was drawn last
  private home: Orbit | null = null;
  private room: Room = { width: 1, height: 1, left: 0, top: 0, right: 1, bottom: 1 };
  private following = false;
  private stale = true;
  private lastDrawing = 0; // [ms] 0: measured
  private drawnAt = -Infinity; // [ms]

  /** Throws if the browser has no WebGL 2. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const probe = document.createElement("canvas").getContext("webgl2");
    if (!probe) throw new Error("this browser has no WebGL 2");
    this.software = isSoftwareRenderer(probe);
    probe.getExtension("WEBGL_lose_context")?.loseContext();
    this.thinning = new Thinning(this.software ? SOFTWARE_LEVEL : 0);
    // A processor that draws has no time for four samples a pixel, nor to mix the page's ground in.
    const fine = !this.software;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: fine, alpha: fine });
    // Asking how the shaders do waits for them to be made, one after the other.
    this.renderer.debug.checkShaderErrors = import.meta.env.DEV;

    this.paint.count = 0;
    this.paint.frustumCulled = false;
    const lines = [
      ...[this.link, this.plumb, this.trail, this.ghostTrail, this.ruler],
      ...[this.grid, this.frusta, this.push, this.otherLines],
    ];
    for (const object of [...lines, this.arm]) object.frustumCulled = false;
    this.shadow.renderOrder = this.ghostTrail.renderOrder = this.ghost.renderOrder = 1;
    this.spot.renderOrder = 1;
    this.hip.renderOrder = 3;
    this.link.renderOrder = 2;
    this.handTool.renderOrder = 1;
    this.handTool.add(this.handToolEdges);
    this.handToolEdges.material.depthTest = false;
    const turning = [this.turning, ...this.contacts].flatMap((mark) => mark.children);
    for (const part of [this.handToolEdges, ...turning]) part.renderOrder = 2;
    this.ring.renderOrder = 4;

    const marks = [
      ...[this.proxy, this.hip, this.ring, this.link, this.plumb, this.trail, this.pin],
      ...[this.ruler, this.shadow, this.spot, this.grid, this.frusta, this.axes],
      ...[this.ghost, this.ghostTrail, this.paint, this.tool, this.arm, this.push],
      ...[this.otherLines, this.heldTool, this.handTool, this.turning, this.arrow],
      ...this.contacts,
    ];
    for (const mark of marks) mark.visible = false;
    this.scene.add(
      ...marks,
      this.felt,
      this.fixtures,
      this.lamp,
      new THREE.HemisphereLight(0xffffff, 0x8899aa, 1.6),
    );
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  get height(): number {
    return this.canvas.clientHeight;
  }

  setPalette(palette: Palette): void {
    this.palette = palette;
    const drawn = {
      proxy: [this.proxy.material, this.heldTool.material],
      hip: [this.hip, this.handTool, this.handToolEdges, this.link].map((mark) => mark.material),
      text: [
        ...[this.ghost, this.ghostTrail, this.ring, this.plumb, this.pin, this.ruler, this.grid],
      ].map((mark) => mark.material),
      calm: [this.trail, this.spot, this.frusta, this.tool, this.arm].map((mark) => mark.material),
      force: [this.overlay, this.acting, this.push.material, this.arrowMaterial],
      fixture: [this.idle],
    };
    for (const [name, materials] of Object.entries(drawn))
      for (const material of materials) material.color.set(palette[name as keyof Palette]);
    this.arrowMaterial.emissive.set(palette.force).multiplyScalar(0.35);
    if (this.software) this.renderer.setClearColor(palette.ground, 1);
    this.look.nearColour.value.set(palette.near);
    this.look.middleColour.value.set(palette.middle);
    this.look.farColour.value.set(palette.far);
    this.look.glow.value.set(palette.force);
    this.touch();
  }

  /** Paint on surfaces. */
  showPaint(dabs: readonly (Spot & { radius: number; colour: string })[]): void {
    const shown = dabs.slice(0, MOST_DABS);
    shown.forEach(({ at, normal, radius, colour }, i) => {
      this.lay(this.dab, { at: add(at, scale(normal, PAINT_LAYER)), normal }, radius);
      this.dab.updateMatrix();
      this.paint.setMatrixAt(i, this.dab.matrix);
      this.paint.setColorAt(i, new THREE.Color(colour));
    });
    this.paint.count = shown.length;
    this.paint.visible = shown.length > 0;
    this.paint.instanceMatrix.needsUpdate = true;
    if (this.paint.instanceColor) this.paint.instanceColor.needsUpdate = true;
    this.touch();
  }

  /** Virtual fixtures by their names, as lines: their ends, x y z after one another [m, world]. */
  showFixtures(fixtures: readonly { name: string; ends: number[] }[]): void {
    const wanted = JSON.stringify(fixtures);
    if (wanted === this.fixturesDrawn) return;
    this.fixturesDrawn = wanted;
    for (const { children } of this.fixtures.children)
      for (const part of children as (THREE.LineSegments | THREE.Sprite)[]) {
        if (part instanceof THREE.Sprite) part.material.map!.dispose(), part.material.dispose();
        else part.geometry.dispose();
      }
    this.fixtures.clear();
    for (const { name, ends } of fixtures) {
      const lines = new THREE.LineSegments(new THREE.BufferGeometry(), this.idle);
      lines.frustumCulled = false;
      this.setLine(lines, ends);
      const highest = Math.max(...ends.filter((_, i) => i % 3 === 2));
      const at = ends.indexOf(highest, 2) - 2;
      const label = nameSprite(name, this.palette.text);
      label.position.set(ends[at] ?? 0, ends[at + 1] ?? 0, ends[at + 2] ?? 0);
      this.fixtures.add(new THREE.Group().add(lines, label));
    }
    this.touch();
  }

  /** Which of the fixtures give a force, a bit each. */
  showActing(bits: number): void {
    this.fixtures.children.forEach(({ children }, i) => {
      const lines = children[0] as THREE.LineSegments;
      const material = (bits & (1 << i)) !== 0 ? this.acting : this.idle;
      if (lines.material !== material) this.touch();
      lines.material = material;
    });
  }

  /** A robot that is led: its tool [m], null where it is not known, its links and lines. */
  showRobot(tool: Vec3 | null, radius: number, links: readonly Vec3[], ends: number[]): void {
    this.tool.visible = tool !== null;
    if (tool) this.tool.position.set(...tool);
    this.tool.scale.setScalar(radius);
    const thick = 1.5 * radius;
    this.arm.count = Math.min(Math.max(links.length - 1, 0), MOST_LINKS);
    for (let i = 0; i < this.arm.count; ++i) {
      const along = sub(links[i + 1]!, links[i]!);
      const long = length(along);
      this.stand(this.dab, links[i]!, long > 0 ? unit(along) : [0, 1, 0], thick, long);
      this.dab.updateMatrix();
      this.arm.setMatrixAt(i, this.dab.matrix);
    }
    this.arm.visible = this.arm.count > 0;
    this.arm.instanceMatrix.needsUpdate = true;
    this.setLine(this.push, ends);
    this.touch();
  }

  /** The hands beside the first, and their lines. */
  showHands(hands: readonly OtherHand[], ends: readonly number[]): void {
    while (this.otherBalls.length < 2 * hands.length) {
      this.otherBalls.push(body({ roughness: 0.35 }));
      this.scene.add(this.otherBalls.at(-1)!);
    }
    hands.forEach(({ hip, proxy, touches }, i) => {
      const [at, pulled] = [this.otherBalls[2 * i]!, this.otherBalls[2 * i + 1]!];
      at.position.set(...proxy);
      at.scale.setScalar(this.radii.r_c);
      at.material.color.copy(touches ? this.proxy.material.color : this.tool.material.color);
      pulled.position.set(...hip);
      pulled.scale.setScalar(0.3 * this.radii.r_c);
      pulled.material.color.copy(this.hip.material.color);
    });
    this.otherLines.material.color.copy(this.hip.material.color);
    this.setLine(this.otherLines, ends);
    this.touch();
  }

  /** The tool in the hand from now on. */
  showTool({ points, triangles }: Tool): void {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(points, 3));
    shape.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.heldTool.geometry.dispose();
    this.heldTool.geometry = this.handTool.geometry = shape;
    this.handToolEdges.geometry.dispose();
    this.handToolEdges.geometry = new THREE.EdgesGeometry(shape, TOOL_EDGES);
    this.reach = 0;
    for (let i = 0; i < points.length; i += 3)
      this.reach = Math.max(this.reach, Math.hypot(...points.subarray(i, i + 3)));
    this.touch();
  }

  setRadii(radii: Radii): void {
    this.radii = radii;
    this.touch();
  }

  setFollowing(following: boolean): void {
    this.following = following;
    this.touch();
  }

  /** Something changed: draw when the browser next can. */
  touch(): void {
    this.stale = true;
  }

  setOrbit(orbit: Orbit): void {
    this.orbit = orbit;
    this.touch();
  }

  /** Forgets what was seen: another session begins. */
  clear(): void {
    for (const cloud of this.clouds.values()) {
      this.felt.remove(cloud.object, cloud.faces);
      cloud.dispose();
    }
    this.felt.visible = true;
    if (this.splat) this.scene.remove(this.splat.object), this.splat.dispose();
    this.splat = null;
    this.clouds.clear();
    this.home = this.tick = this.pointedAt = this.under = null;
    this.showTool(NO_TOOL);
    this.trailPoints.length = this.drawnPoints = 0;
    this.ghost.visible = this.ghostTrail.visible = false;
    for (const lines of [this.grid, this.frusta, this.trail]) lines.visible = false;
    this.touch();
  }

  /** The view that the newest frames ask for. */
  resetView(): void {
    const seen = this.splat ? [this.splat.seen] : this.surfaces;
    const pose = this.shown[0]?.worldFromCamera;
    const home = pose && firstView(seen, pose, this.room, this.splat !== null);
    if (!home) return;
    this.home = home;
    this.setOrbit(home);
  }

  /** Which part of the window is free: what the eye looks at is in its middle. */
  setRoom(room: Room): void {
    const isSame = Object.entries(room).every(([side, at]) => this.room[side as keyof Room] === at);
    if (isSame) return;
    this.room = room;
    if (this.orbit === this.home) this.resetView();
    this.touch();
  }

  showFrame(frame: Frame): void {
    const cloud = this.cloudOf(frame.camera);
    const isFirst = cloud.frame === null;
    cloud.show(frame);
    ++this.frames;
    // Until somebody looks elsewhere, the view follows what cameras join.
    if (isFirst && (!this.home || this.orbit === this.home)) this.resetView();
    this.placeCameras();
    this.touch();
  }

  /** What the cameras look at, if it is a splat. It is drawn in place of what is felt of it. */
  showSplat(gaussians: Float32Array): void {
    const isAtHome = this.orbit === this.home;
    this.splat = new SplatCloud(gaussians, this.software);
    this.scene.add(this.splat.object);
    this.felt.visible = this.grid.visible = false;
    if (isAtHome) this.resetView();
    this.placeCameras();
    this.touch();
  }

  /** Is the felt surface drawn? Always, where there is no splat. */
  get showsFelt(): boolean {
    return this.felt.visible;
  }

  showFelt(shown: boolean): void {
    this.felt.visible = shown;
    this.touch();
  }

  /** Before the camera's first frame. */
  setRays(rays: Rays): void {
    this.cloudOf(rays.camera).setRays(rays);
  }

  showTick(tick: Ticks): void {
    const before = this.tick;
    const drawn = (of: Ticks) => [
      ...[of.hip, of.place, of.force, of.normal, of.torque, of.orientation, of.proxyOrientation],
      ...of.contacts.flatMap(({ at, push }) => [at, push]),
    ].flat();
    const [now, last] = [drawn(tick), before ? drawn(before) : []];
    const moves = now.length !== last.length || now.some((x, i) => Math.abs(x - last[i]!) > 1e-5);
    this.tick = tick;
    // What rests is not drawn anew thirty times a second.
    if (!moves && this.trailPoints.length === 0 && tick.state === before?.state) return;
    if (tick.state !== 0) this.trailPoints.push(...tick.proxy);
    else this.trailPoints.splice(0, 6); // it fades from its tail while nothing is touched
    this.trailPoints.splice(0, this.trailPoints.length - 3 * TRAIL);
    this.touch();
  }

  /** Have the cameras colours of their own? */
  get hasColour(): boolean {
    return [...this.clouds.values()].some((cloud) => cloud.hasColour);
  }

  /** Are they drawn? */
  get showsColour(): boolean {
    return this.look.tinted.value && this.hasColour;
  }

  /** Is the world the camera's own frame, as no pose is known? */
  get inOwnFrame(): boolean {
    return this.shown.some((frame) => frame.worldFromCamera.every((x, i) => x === +(i % 5 === 0)));
  }

  /** Draws the cameras' own colours, where they have any, or those of depth. */
  switchTint(): void {
    this.look.tinted.value = !this.look.tinted.value;
    this.touch();
  }

  /** [m] between what is measured about the hand; null: nothing is. */
  spacing(): number | null {
    if (!this.tick || this.clouds.size === 0) return null;
    const { proxy } = this.tick;
    const at = this.under?.spot.at ?? proxy;
    return Math.min(...[...this.clouds.values()].map((cloud) => cloud.spacingAt(at)));
  }

  /** Where the hand was when this was recorded [m]; null: it was not. */
  showGhost(at: Vec3 | null, trail: readonly number[] = []): void {
    const { position, visible } = this.ghost;
    if (visible === (at !== null) && (!at || length(sub(at, position.toArray())) < 1e-5)) return;
    this.ghost.visible = this.ghostTrail.visible = at !== null;
    if (at) position.set(...at);
    this.setLine(this.ghostTrail, trail);
    this.ghost.scale.setScalar(this.radii.r_c);
    this.touch();
  }

  /** How high the proxy is above what the cameras see [m]; null: nothing is seen behind it. */
  clearance(): number | null {
    return this.under?.height ?? null;
  }

  /** The eye, and where it looks through a place of the window [px]. */
  rayUnder(x: number, y: number): { from: Vec3; along: Vec3 } {
    const box = this.canvas.getBoundingClientRect();
    const off = offCentre(this.room);
    const right = x - box.left - 0.5 * box.width - off.x;
    const down = y - box.top - 0.5 * box.height - off.y;
    const along = rayThrough(this.orbit, right, down, box.height);
    return { from: eye(this.orbit), along };
  }

  /** The surface under a place of the window [px]; null: there is none. */
  spotUnder(x: number, y: number): Spot | null {
    const box = this.canvas.getBoundingClientRect();
    if (x < box.left || y < box.top || x >= box.right || y >= box.bottom) return null;
    const { from, along } = this.rayUnder(x, y);
    const met = this.surfaces.flatMap((seen) => seen.meet(from, along) ?? []);
    const nearest = leastOf(met, ({ distance }) => distance);
    return (nearest ?? this.splat?.seen.meet(from, along))?.spot ?? null;
  }

  /** The same, and where; in a hole of a camera's image, the nearest surface about it. */
  surfaceNear(at: Place): { at: Place; spot: Spot } | null {
    // Points without an image are met from some way beside them, and looking at many takes long.
    const hasImage = !this.splat && this.surfaces.some(({ unordered }) => unordered === 0);
    const near = nearestAbout(at, (place) =>
      place === at || hasImage ? this.spotUnder(place.x, place.y) : null,
    );
    return near && { at: near.at, spot: near.found };
  }

  /** A line between places that were picked. */
  showRuler(places: readonly Vec3[]): void {
    this.setLine(this.ruler, places.flat());
    this.touch();
  }

  /** Where a pointer would press; null: nowhere. */
  setPointer(spot: Spot | null): void {
    if (spot === this.pointedAt) return;
    this.pointedAt = spot;
    this.touch();
  }

  /** How far a place is before what a camera sees, along the nearest sightline; see Ahead. */
  ahead(place: Vec3): { distance: number; towards: Vec3 } | null {
    if (this.splat) {
      // What is felt is a window about the hand: what is in between is seen from the eye alone.
      const from = eye(this.orbit);
      const towards = unit(sub(from, place));
      const reach = this.splat.seen.firstPoint(from, scale(towards, -1));
      return reach === null ? null : { distance: reach - length(sub(place, from)), towards };
    }
    const sightlines = this.surfaces.flatMap((seen) => {
      const hit = seen.onSightline(place);
      if (!hit) return [];
      const towards = unit(sub(seen.eye, hit));
      return { distance: dot(sub(place, hit), towards), towards };
    });
    return leastOf(sightlines, ({ distance }) => Math.abs(distance));
  }

  /** The surface on a camera's sightline through a place, whether that is before it or behind. */
  spotAt(place: Vec3): Spot | null {
    const seen = this.ahead(place);
    if (!seen) return null;
    // From before the surface.
    const before = add(place, scale(seen.towards, Math.max(0, 0.02 - seen.distance)));
    const along = scale(seen.towards, -1);
    const spots = this.surfaces.flatMap((surface) => surface.meet(before, along)?.spot ?? []);
    return leastOf(spots, ({ at }) => length(sub(at, place)));
  }

  depthRange(): [number, number] | null {
    const first = this.clouds.values().next();
    return first.done ? null : first.value.range;
  }

  /** Draws if something changed. @param now [ms] */
  draw(now: number): boolean {
    if (this.following && this.tick) this.follow(this.tick.proxy);
    // What a drawing costs shows in when the browser is ready for the next.
    if (this.lastDrawing > 0) this.thinning.measure((now - this.lastDrawing) / 1000);
    this.lastDrawing = 0;
    if (!this.palette || (this.software && now - this.drawnAt < SOFTWARE_INTERVAL)) return false;
    const rests = !this.stale && now - this.drawnAt > REST;
    if (!this.stale && (!rests || this.thinning.resting || !this.thinning.canRefine)) return false;
    this.stale = false;
    this.thinning.resting = rests;
    this.drawnAt = now;
    this.lastDrawing = rests ? 0 : now; // what is drawn once may take its time

    const at = eye(this.orbit);
    const { up, right, forward } = axes(this.orbit);
    this.camera.position.set(...at);
    this.camera.up.set(...up);
    this.camera.lookAt(...this.orbit.target);
    this.camera.near = Math.max(0.002, 0.02 * this.orbit.distance);
    this.camera.far = 3 * this.orbit.distance + 30;
    const { clientWidth, clientHeight } = this.canvas;
    const off = offCentre(this.room);
    this.camera.setViewOffset(clientWidth, clientHeight, -off.x, -off.y, clientWidth, clientHeight);
    const above = add(scale(this.orbit.up, 0.55), scale(up, 0.5));
    const lampAt = unit(sub(above, add(scale(right, 0.45), scale(forward, 0.6))));
    this.lamp.position.set(...lampAt);

    this.setResolution();
    const pixelsPerMetre = this.canvas.height / (2 * Math.tan(FIELD_OF_VIEW / 2));
    this.drawnPoints = 0;
    const { r_1, r_3 } = this.reach > 0 ? { r_1: 0, r_3: 0 } : this.radii;
    this.look.radii.value.set(r_1, r_3, 0);
    this.look.proxy.value.set(...(this.tick?.proxy ?? FAR_AWAY));
    this.look.light.value.set(...lampAt);
    for (const cloud of this.clouds.values()) {
      cloud.prepare(this.thinning.stride, pixelsPerMetre, this.renderer.getPixelRatio());
      if (cloud.object.visible && this.felt.visible)
        this.drawnPoints += cloud.object.geometry.drawRange.count;
    }
    if (this.splat) {
      const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
      if (this.splat.prepare(at, forward, this.orbit.distance, size, now)) this.touch();
      this.drawnPoints += this.splat.count;
    }
    if (this.tick) this.placeMarks(this.tick);
    this.renderer.render(this.scene, this.camera);
    ++this.drawings;
    return true;
  }

  // The cameras' newest frames, and what they measured.
  private get shown(): Frame[] {
    return [...this.clouds.values()].flatMap(({ frame }) => frame ?? []);
  }
  private get surfaces(): SeenSurface[] {
    return [...this.clouds.values()].flatMap(({ seen }) => seen ?? []);
  }

  private cloudOf(camera: number): CameraCloud {
    let cloud = this.clouds.get(camera);
    if (!cloud) {
      cloud = new CameraCloud(this.look);
      this.clouds.set(camera, cloud);
      this.felt.add(cloud.object, cloud.faces);
    }
    return cloud;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.setResolution();
    this.camera.aspect = clientWidth / clientHeight;
    this.touch();
  }

  // Of the picture: coarser where not even few points are drawn fast enough.
  private setResolution(): void {
    const full = this.software ? 1 : Math.min(devicePixelRatio, 2);
    const ratio = full * this.thinning.resolution;
    if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
  }

  private follow(at: Vec3): void {
    const away = sub(at, this.orbit.target);
    if (length(away) < 2e-4) return;
    this.setOrbit({ ...this.orbit, target: add(this.orbit.target, scale(away, 0.12)) });
  }

  // Once: from what is seen at first. A moving camera's frustum moves with it.
  private placeCameras(): void {
    this.setLine(this.frusta, this.shown.flatMap(cameraLines));
    if (this.grid.visible || !this.home) return;
    const first = this.splat ?? this.clouds.values().next().value!;
    const floor = floorUnder(first.seen?.places(2000) ?? [], this.orbit.up);
    this.setLine(this.grid, floor ? gridLines(floor, this.orbit.up) : []);
    this.axes.visible = true;
  }

  private placeMarks(tick: Ticks): void {
    const { r_c } = this.radii;
    const touching = tick.state !== 0;
    const place = (mark: THREE.Object3D, at: Vec3, size: number) => {
      mark.visible = true;
      mark.position.set(...at);
      mark.scale.setScalar(size);
    };
    place(this.proxy, tick.place, r_c); // forbidden regions keep it, too
    this.proxy.visible = this.reach === 0;
    place(this.heldTool, tick.place, 1);
    this.heldTool.quaternion.set(...tick.proxyOrientation);
    place(this.handTool, tick.hip, 1);
    this.handTool.quaternion.set(...tick.orientation);
    this.heldTool.visible = this.handTool.visible = this.reach > 0;
    place(this.hip, tick.hip, 0.3 * r_c);
    // The ring is there to find the proxy from afar; near by, the sphere speaks for itself.
    const size = metresPerPixel(depthOf(this.orbit, tick.place), this.height);
    const ringSize = (RING_WIDTH / Math.max(this.height, 1)) * Math.tan(FIELD_OF_VIEW / 2);
    place(this.ring, tick.place, ringSize);
    const radius = (this.reach || r_c) / size;
    this.ring.material.opacity = Math.min(1, Math.max(0, (24 - radius) / 12)) * 0.85;
    this.ring.visible = this.ring.material.opacity > 0;

    this.setLine(this.link, [...tick.place, ...tick.hip]);
    this.link.visible = length(sub(tick.hip, tick.place)) > 0.3 * r_c;

    const hasNormal = length(tick.normal) > 0.5;
    this.pin.visible = hasNormal && this.reach === 0;
    if (hasNormal) this.stand(this.pin, tick.proxy, tick.normal, r_c, PIN * r_c);

    const force = { at: tick.place, push: tick.force };
    this.point(this.arrow, force, ARROW_WIDTH, this.reach > 0 ? 0 : r_c);
    this.contacts.forEach((mark, i) =>
      this.point(mark, tick.contacts[i] ?? NO_CONTACT, CONTACT_WIDTH),
    );

    const turns = length(tick.torque);
    this.turning.visible = turns > LEAST_TORQUE;
    const turnRadius = clamp(turns * RING_PER_NEWTON_METRE, ...RINGS) * size * this.height;
    const about = { at: tick.place, normal: unit(tick.torque) };
    if (this.turning.visible) this.lay(this.turning, about, turnRadius);

    // The shadow on what the hand is over, and the line down to it.
    const spot = this.spotAt(tick.proxy);
    const under = spot && { spot, height: dot(sub(tick.proxy, spot.at), spot.normal) };
    this.under = under;
    const near = under !== null && Math.abs(under.height) < 0.5;
    this.shadow.visible = near && under.height > 0.5 * r_c;
    this.plumb.visible = false;
    if (near) {
      this.lay(this.shadow, under.spot, Math.max(r_c, 5 * size));
      this.setLine(this.plumb, [...tick.proxy, ...under.spot.at]);
      this.plumb.computeLineDistances();
      this.plumb.visible = !touching;
    }
    this.spot.visible = this.pointedAt !== null;
    if (this.pointedAt) {
      const pixel = metresPerPixel(depthOf(this.orbit, this.pointedAt.at), this.height);
      this.lay(this.spot, this.pointedAt, SPOT_SIZE * pixel);
    }
    this.setLine(this.trail, this.trailPoints);
  }

  // Lays a flat mark on a surface.
  private lay(mark: THREE.Object3D, { at, normal }: Spot, size: number): void {
    mark.position.set(...at);
    mark.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...normal));
    mark.scale.setScalar(size);
  }

  // Makes an arrow of a push, `off` [m] before its place; none of a small one.
  private point(mark: THREE.Group, { at, push }: Contact, width: number, off = 0): void {
    const newtons = length(push);
    mark.visible = newtons > LEAST_FORCE;
    if (!mark.visible) return;
    const [shaft, head] = mark.children;
    const along = unit(push);
    const view = this.height * metresPerPixel(depthOf(this.orbit, at), this.height); // [m]
    const long = Math.min(newtons * ARROW_PER_NEWTON, LONGEST_ARROW) * view;
    const wide = width * view;
    const headLength = Math.min(0.4 * long, 4 * wide);
    this.stand(shaft!, [0, 0, 0], [0, 1, 0], 0.55 * wide, long - headLength);
    this.stand(head!, [0, long - headLength, 0], [0, 1, 0], 1.5 * wide, headLength);
    this.stand(mark, add(at, scale(along, off)), along, 1, 1);
  }

  // Puts an upright mark's foot at a place and its top along a direction.
  private stand(mark: THREE.Object3D, foot: Vec3, along: Vec3, width: number, height: number) {
    mark.position.set(...foot);
    mark.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...along));
    mark.scale.set(width, height, width);
  }

  private setLine(line: THREE.Line, points: readonly number[]): void {
    let position = line.geometry.getAttribute("position") as THREE.BufferAttribute | undefined;
    if (!position || position.array.length < points.length) {
      line.geometry.dispose(); // the buffer that was too small
      position = new THREE.BufferAttribute(new Float32Array(points.length), 3);
      line.geometry.setAttribute("position", position);
    }
    position.array.set(points);
    position.needsUpdate = true;
    line.geometry.setDrawRange(0, points.length / 3);
    line.visible = points.length > 0;
  }
}
