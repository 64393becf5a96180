// SPDX-License-Identifier: Apache-2.0
// What is drawn: the clouds, the proxy at its true size, the hand, the normal's pin and the force's
// arrow, as in the paper's Figs. 10 and 15.

import * as THREE from "three";
import { CameraCloud } from "./cloud";
import {
  axes,
  depthOf,
  dot,
  eye,
  FIELD_OF_VIEW,
  length,
  lookAt,
  metresPerPixel,
  sub,
  turned,
  unit,
  upFromPose,
  zoomed,
  type Orbit,
} from "./camera_math";
import type { Frame, Rays, Ticks, Vec3 } from "./protocol";
import { Thinning } from "./thinning";

const ARROW_PER_NEWTON = 0.055; // of the view's height
const LONGEST_ARROW = 0.4; // likewise
const PIN = 3.2; // contact radii
const TRAIL = 360; // ticks messages

export interface Radii {
  r_c: number;
  r_1: number;
  r_3: number;
}

export interface Palette {
  near: string;
  middle: string;
  far: string;
  force: string;
  hip: string;
  proxy: string;
  calm: string;
  text: string;
}

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

function isSoftwareRenderer(renderer: THREE.WebGLRenderer): boolean {
  const gl = renderer.getContext();
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}

export class SceneView {
  orbit: Orbit = lookAt([0.2, -0.4, 0.5], [0, 0, 0], [0, 0, 1]);
  readonly thinning = new Thinning();
  /** How many points the last drawing was given, for tests and the session's facts. */
  drawnPoints = 0;
  drawings = 0;

  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(
    (FIELD_OF_VIEW * 180) / Math.PI,
    1,
    0.01,
    100,
  );
  private readonly clouds = new Map<number, CameraCloud>();
  private readonly proxy: THREE.Mesh<THREE.SphereGeometry, THREE.MeshStandardMaterial>;
  private readonly ring: THREE.Sprite;
  private readonly hip: THREE.Mesh<THREE.SphereGeometry, THREE.MeshBasicMaterial>;
  private readonly link: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly plumb: THREE.Line<THREE.BufferGeometry, THREE.LineDashedMaterial>;
  private readonly trail: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly pin: THREE.Mesh<THREE.CylinderGeometry, THREE.MeshStandardMaterial>;
  private readonly arrow = new THREE.Group();
  private readonly shaft: THREE.Mesh;
  private readonly head: THREE.Mesh;
  private readonly arrowMaterial = new THREE.MeshStandardMaterial({ roughness: 0.5 });
  private readonly lamp = new THREE.DirectionalLight(0xffffff, 2.2);
  private readonly trailPoints: number[] = [];
  private palette!: Palette;
  private radii: Radii = { r_c: 0.005, r_1: 0.00499, r_3: 0.01 };
  private tick: Ticks | null = null;
  private home: Orbit | null = null;
  private following = false;
  private stale = true;
  private lastDrawing = 0;
  private readonly software: boolean;

  /** Throws if the browser has no WebGL 2. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const probe = document.createElement("canvas").getContext("webgl2");
    if (!probe) throw new Error("this browser has no WebGL 2");
    probe.getExtension("WEBGL_lose_context")?.loseContext();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.software = isSoftwareRenderer(this.renderer);

    const ball = new THREE.SphereGeometry(1, 48, 32);
    this.proxy = new THREE.Mesh(ball, new THREE.MeshStandardMaterial({ roughness: 0.35 }));
    this.hip = new THREE.Mesh(ball, new THREE.MeshBasicMaterial({ depthTest: false }));
    this.ring = new THREE.Sprite(
      new THREE.SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false }),
    );
    const line = (points: number): THREE.BufferGeometry =>
      new THREE.BufferGeometry().setAttribute(
        "position",
        new THREE.BufferAttribute(new Float32Array(3 * points), 3),
      );
    this.link = new THREE.Line(line(2), new THREE.LineBasicMaterial({ depthTest: false }));
    this.plumb = new THREE.Line(
      line(2),
      new THREE.LineDashedMaterial({ dashSize: 0.004, gapSize: 0.003 }),
    );
    this.trail = new THREE.Line(
      line(TRAIL),
      new THREE.LineBasicMaterial({ transparent: true, opacity: 0.7 }),
    );
    this.pin = new THREE.Mesh(
      new THREE.CylinderGeometry(0.09, 0.09, 1, 12).translate(0, 0.5, 0),
      new THREE.MeshStandardMaterial({ roughness: 0.6 }),
    );
    this.shaft = new THREE.Mesh(
      new THREE.CylinderGeometry(1, 1, 1, 20).translate(0, 0.5, 0),
      this.arrowMaterial,
    );
    this.head = new THREE.Mesh(
      new THREE.ConeGeometry(1, 1, 28).translate(0, 0.5, 0),
      this.arrowMaterial,
    );
    this.arrow.add(this.shaft, this.head);
    for (const object of [this.link, this.plumb, this.trail]) object.frustumCulled = false;
    this.hip.renderOrder = 3;
    this.link.renderOrder = 2;
    this.ring.renderOrder = 4;

    const marks = [this.proxy, this.hip, this.ring, this.link, this.plumb, this.trail, this.pin];
    for (const mark of marks) mark.visible = false;
    this.arrow.visible = false;
    this.scene.add(
      ...marks,
      this.arrow,
      this.lamp,
      new THREE.HemisphereLight(0xffffff, 0x8899aa, 1.6),
    );
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  get arrowShown(): boolean {
    return this.arrow.visible;
  }

  get height(): number {
    return this.canvas.clientHeight;
  }

  setPalette(palette: Palette): void {
    this.palette = palette;
    const colour = (text: string) => new THREE.Color(text);
    this.proxy.material.color = colour(palette.proxy);
    this.hip.material.color = colour(palette.hip);
    this.link.material.color = colour(palette.hip);
    this.ring.material.color = colour(palette.text);
    this.plumb.material.color = colour(palette.text);
    this.trail.material.color = colour(palette.calm);
    this.pin.material.color = colour(palette.text);
    this.arrowMaterial.color = colour(palette.force);
    this.arrowMaterial.emissive = colour(palette.force).multiplyScalar(0.35);
    for (const cloud of this.clouds.values()) cloud.setColours(this.cloudColours());
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

  resetView(): void {
    if (this.home) this.setOrbit(this.home);
  }

  showFrame(frame: Frame): void {
    let cloud = this.clouds.get(frame.camera);
    if (!cloud) {
      cloud = new CameraCloud();
      cloud.setColours(this.cloudColours());
      this.clouds.set(frame.camera, cloud);
      this.scene.add(cloud.object);
    }
    cloud.show(frame);
    if (!this.home) this.findHome(frame, cloud);
    this.touch();
  }

  setRays(rays: Rays): void {
    this.clouds.get(rays.camera)?.setRays(rays);
  }

  showTick(tick: Ticks): void {
    this.tick = tick;
    if (tick.state !== 0) this.trailPoints.push(...tick.proxy);
    else this.trailPoints.splice(0, 6); // it fades from its tail while nothing is touched
    this.trailPoints.splice(0, this.trailPoints.length - 3 * TRAIL);
    this.touch();
  }

  /** How far the proxy is in front of what the cameras see [m], along the nearest sightline. */
  clearance(): number | null {
    if (!this.tick) return null;
    const hit = this.surfaceBehind(this.tick.proxy);
    return hit === null ? null : length(sub(hit, this.tick.proxy)) - this.radii.r_c;
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
    if (!this.stale || !this.palette) return false;
    this.stale = false;
    this.lastDrawing = now;

    const at = eye(this.orbit);
    const { up, right } = axes(this.orbit);
    this.camera.position.set(...at);
    this.camera.up.set(...up);
    this.camera.lookAt(...this.orbit.target);
    this.camera.near = Math.max(0.002, 0.02 * this.orbit.distance);
    this.camera.far = this.orbit.distance + 30;
    this.camera.updateProjectionMatrix();
    const lampAt: Vec3 = unit(
      [0, 1, 2].map(
        (i) =>
          0.55 * this.orbit.up[i]! +
          0.5 * up[i]! -
          0.45 * right[i]! +
          (0.6 * (at[i]! - this.orbit.target[i]!)) / this.orbit.distance,
      ) as unknown as Vec3,
    );
    this.lamp.position.set(...lampAt);

    const pixelsPerMetre = this.canvas.height / (2 * Math.tan(FIELD_OF_VIEW / 2));
    this.drawnPoints = 0;
    for (const cloud of this.clouds.values()) {
      cloud.prepare(this.thinning.stride, pixelsPerMetre, this.renderer.getPixelRatio());
      cloud.setLight(lampAt);
      if (this.tick) cloud.setProxy(this.tick.proxy, this.radii.r_1, this.radii.r_3);
      this.drawnPoints += cloud.object.geometry.drawRange.count;
    }
    if (this.tick) this.placeMarks(this.tick);
    this.renderer.render(this.scene, this.camera);
    ++this.drawings;
    return true;
  }

  private cloudColours() {
    const { near, middle, far, force } = this.palette;
    const [n, m, f, g] = [near, middle, far, force].map((c) => new THREE.Color(c));
    return { near: n!, middle: m!, far: f!, glow: g! };
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(this.software ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.touch();
  }

  // The scene as its first camera sees it, but from a little aside and farther, to show its depth.
  private findHome(frame: Frame, cloud: CameraCloud): void {
    const pose = frame.worldFromCamera;
    const from: Vec3 = [pose[3]!, pose[7]!, pose[11]!];
    const forward: Vec3 = [pose[2]!, pose[6]!, pose[10]!];
    const middle = 0.5 * (cloud.range[0] + cloud.range[1]);
    const target = [0, 1, 2].map((i) => from[i]! + middle * forward[i]!) as unknown as Vec3;
    const straight = lookAt(from, target, upFromPose(pose));
    this.home = turned(zoomed(straight, 1.15 / Math.min(1, this.camera.aspect)), 0.35, -0.12);
    this.setOrbit(this.home);
  }

  private follow(at: Vec3): void {
    const away = sub(at, this.orbit.target);
    if (length(away) < 2e-4) return;
    const target = [0, 1, 2].map((i) => this.orbit.target[i]! + 0.12 * away[i]!) as unknown as Vec3;
    this.setOrbit({ ...this.orbit, target });
  }

  private surfaceBehind(point: Vec3): Vec3 | null {
    let best: Vec3 | null = null;
    for (const cloud of this.clouds.values()) {
      const hit = cloud.onSightline(point);
      if (hit && (!best || length(sub(hit, point)) < length(sub(best, point)))) best = hit;
    }
    return best;
  }

  private placeMarks(tick: Ticks): void {
    const { r_c } = this.radii;
    const touching = tick.state !== 0;
    const place = (mark: THREE.Object3D, at: Vec3, size: number) => {
      mark.visible = true;
      mark.position.set(...at);
      mark.scale.setScalar(size);
    };
    place(this.proxy, tick.proxy, r_c);
    place(this.hip, tick.hip, 0.3 * r_c);
    // The ring is there to find the proxy from afar; near by, the sphere speaks for itself.
    const size = metresPerPixel(depthOf(this.orbit, tick.proxy), this.height);
    place(
      this.ring,
      tick.proxy,
      ((2 * 15) / Math.max(this.height, 1)) * Math.tan(FIELD_OF_VIEW / 2),
    );
    const radius = r_c / size;
    this.ring.material.opacity = Math.min(1, Math.max(0, (24 - radius) / 12)) * 0.85;
    this.ring.visible = this.ring.material.opacity > 0;

    this.setLine(this.link, [...tick.proxy, ...tick.hip]);
    this.link.visible = length(sub(tick.hip, tick.proxy)) > 0.3 * r_c;

    const hasNormal = length(tick.normal) > 0.5;
    this.pin.visible = hasNormal;
    if (hasNormal) this.stand(this.pin, tick.proxy, tick.normal, r_c, PIN * r_c);

    const newtons = length(tick.force);
    const shown = Math.min(newtons * ARROW_PER_NEWTON, LONGEST_ARROW) * size * this.height;
    this.arrow.visible = newtons > 0.01;
    if (this.arrow.visible) {
      const direction = unit(tick.force);
      const foot = [0, 1, 2].map((i) => tick.proxy[i]! + r_c * direction[i]!) as unknown as Vec3;
      const thickness = 0.006 * size * this.height;
      const headLength = Math.min(0.4 * shown, 4 * thickness);
      this.stand(this.shaft, [0, 0, 0], [0, 1, 0], thickness * 0.55, shown - headLength);
      this.stand(this.head, [0, shown - headLength, 0], [0, 1, 0], thickness * 1.5, headLength);
      this.stand(this.arrow, foot, direction, 1, 1);
    }

    const hit = touching ? null : this.surfaceBehind(tick.proxy);
    this.plumb.visible = hit !== null && dot(sub(hit, tick.proxy), sub(hit, tick.proxy)) < 0.25;
    if (hit && this.plumb.visible) {
      this.setLine(this.plumb, [...tick.proxy, ...hit]);
      this.plumb.computeLineDistances();
    }
    this.trail.visible = this.trailPoints.length > 3;
    this.setLine(this.trail, this.trailPoints);
  }

  // Puts an upright mark's foot at a place and its top along a direction.
  private stand(
    mark: THREE.Object3D,
    foot: Vec3,
    along: Vec3,
    width: number,
    height: number,
  ): void {
    mark.position.set(...foot);
    mark.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...along));
    mark.scale.set(width, height, width);
  }

  private setLine(line: THREE.Line, points: readonly number[]): void {
    const position = line.geometry.getAttribute("position") as THREE.BufferAttribute;
    position.array.set(points.slice(0, position.array.length));
    position.needsUpdate = true;
    line.geometry.setDrawRange(0, points.length / 3);
  }
}
