// SPDX-License-Identifier: Apache-2.0
// The depth camera of a phone or headset, where its browser gives that by WebXR, as a live camera.

const INTERVAL = 30; // [ms] between frames, at least

type Pose = Pick<XRRigidTransform, "matrix">;

/** A depth image in millimetres, and where it was taken. */
export interface DepthFrame {
  width: number;
  height: number;
  depth: Uint16Array;
  camera: Float64Array; // [px] focal lengths and principal point
  /** [m] world from optical axes, 4 x 4, column by column; the world's z points up */
  pose: Float64Array;
}

/**
 * The pinhole camera of a depth buffer, whose rows may lie along any side of the view. Null: they
 * lie askew or mirrored.
 */
export function pinholeOf(
  view: Pick<XRView, "projectionMatrix"> & { transform: Pose },
  depth: Pick<XRDepthInformation, "width" | "height"> & { normDepthBufferFromNormView: Pose },
): Pick<DepthFrame, "camera" | "pose"> | null {
  const p = view.projectionMatrix;
  const n = depth.normDepthBufferFromNormView.matrix;
  // Place in the buffer [px] = rows * slopes + middle. Slopes [-] are those of a line of sight, to
  // the right and downwards in the view.
  const row = (i: 0 | 1, pixels: number) => {
    const across = 0.5 * pixels * n[i]!;
    const down = 0.5 * pixels * n[4 + i]!;
    const middle = across * (1 - p[8]!) + down * (1 + p[9]!) + pixels * n[12 + i]!;
    return { x: across * p[0]!, y: down * p[5]!, middle };
  };
  const u = row(0, depth.width);
  const v = row(1, depth.height);
  const fx = Math.hypot(u.x, u.y);
  const fy = Math.hypot(v.x, v.y);
  // The buffer's axes in the view: the optical axes are turned by them about the line of sight.
  const [ux, uy, vx, vy] = [u.x / fx, u.y / fx, v.x / fy, v.y / fy];
  const ALIKE = 1e-3; // [-]
  if (!(Math.abs(ux * vx + uy * vy) < ALIKE && ux * vy - uy * vx > 0)) return null;
  const t = view.transform.matrix;
  // WebXR: x to the right, y up, and looking along -z. Its world has y up, ours z.
  const turned = (x: number, y: number, z: number, w: number) => {
    const at = [0, 1, 2].map((i) => t[i]! * x - t[4 + i]! * y - t[8 + i]! * z + t[12 + i]! * w);
    return [at[0]!, -at[2]!, at[1]!, w];
  };
  const pose = [turned(ux, uy, 0, 0), turned(vx, vy, 0, 0), turned(0, 0, 1, 0), turned(0, 0, 0, 1)];
  return {
    camera: Float64Array.of(fx, fy, u.middle - 0.5, v.middle - 0.5),
    pose: Float64Array.from(pose.flat()),
  };
}

function millimetres(depth: XRCPUDepthInformation, format?: XRDepthDataFormat): Uint16Array {
  const raw = format === "float32" ? new Float32Array(depth.data) : new Uint16Array(depth.data);
  const factor = 1000 * depth.rawValueToMeters;
  return Uint16Array.from(raw, (value) => Math.min(Math.max(Math.round(value * factor), 0), 65535));
}

/** Can this browser show what is before it, with its depth? */
export const hasDepth = async (): Promise<boolean> =>
  (await navigator.xr?.isSessionSupported("immersive-ar").catch(() => false)) ?? false;

/**
 * Gives frames until the session ends. The page stays over the camera's picture.
 * @returns what ends it
 */
export async function watchDepth(
  take: (frame: DepthFrame) => void,
  ended: () => void,
): Promise<() => void> {
  const session = await navigator.xr!.requestSession("immersive-ar", {
    requiredFeatures: ["depth-sensing"],
    optionalFeatures: ["dom-overlay"],
    domOverlay: { root: document.body },
    depthSensing: {
      usagePreference: ["cpu-optimized"],
      dataFormatPreference: ["luminance-alpha", "float32"],
    },
  });
  session.addEventListener("end", ended);
  const gl = document.createElement("canvas").getContext("webgl", { xrCompatible: true })!;
  void session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
  const space = await session.requestReferenceSpace("local");
  let last = -INTERVAL;
  const draw = (time: number, frame: XRFrame) => {
    session.requestAnimationFrame(draw);
    const view = frame.getViewerPose(space)?.views[0];
    const depth = view && frame.getDepthInformation(view);
    const camera = depth && pinholeOf(view, depth);
    if (!camera || time - last < INTERVAL) return;
    last = time;
    const { width, height } = depth;
    take({ width, height, depth: millimetres(depth, session.depthDataFormat), ...camera });
  };
  session.requestAnimationFrame(draw);
  return () => void session.end();
}
