// The scene around the points: the chief's body, the distances allowed, the field of view, the Sun, the force,
// the direction to look at, and where the deputy has been. The recording holds numbers; this makes shapes of them.
import { Color, Quaternion, SceneEntity, SceneUpdate, Time, Vector3 } from "@foxglove/schemas";
import { Input } from "./types";

export const inputs = ["/deputy/state", "/deputy/control", "/guidance", "/mission"];
export const output = "/studio_script/scene";

type Event = Input<"/deputy/state"> | Input<"/deputy/control"> | Input<"/guidance"> | Input<"/mission">;

// what the layout's variables tell; a flight of another mission has others, see metadata `episode`
type GlobalVariables = {
  inspection_radius_m: number;
  min_distance_m: number;
  max_distance_m: number;
  half_angle_deg: number;
  boresight_x: number;
  boresight_y: number;
  boresight_z: number;
  force_arrow_m_per_n: number;
};

const BODY: Color = { r: 0.17, g: 0.19, b: 0.24, a: 1 };
const SHELL: Color = { r: 0.72, g: 0.25, b: 0.28, a: 0.7 };
const CAMERA: Color = { r: 0.59, g: 0.75, b: 1, a: 0.18 };
const SUN: Color = { r: 1, g: 0.84, b: 0.25, a: 1 };
const TARGET: Color = { r: 0, g: 0.82, b: 0.9, a: 1 };
const FORCE: Color = { r: 1, g: 0.51, b: 0.24, a: 1 };
const TRAIL: Color = { r: 0.6, g: 0.65, b: 0.75, a: 0.8 };

const ORIGIN: Vector3 = { x: 0, y: 0, z: 0 };
const UPRIGHT: Quaternion = { x: 0, y: 0, z: 0, w: 1 };
const X_AXIS: Vector3 = { x: 1, y: 0, z: 0 };
const Z_AXIS: Vector3 = { x: 0, y: 0, z: 1 };
const RING_POINTS = 96;

let position: Vector3 | undefined;
let force: Vector3 = ORIGIN;
let target: Vector3 = ORIGIN;
let sun: Vector3 = ORIGIN;
let trail: { seconds: number; position: Vector3 }[] = [];

function vector(row: ArrayLike<number>): Vector3 {
  return { x: row[0] ?? 0, y: row[1] ?? 0, z: row[2] ?? 0 };
}

function times(factor: number, v: Vector3): Vector3 {
  return { x: factor * v.x, y: factor * v.y, z: factor * v.z };
}

function length(v: Vector3): number {
  return Math.hypot(v.x, v.y, v.z);
}

/** The rotation that turns one unit vector into another, the shortest way. */
function turning(from: Vector3, to: Vector3): Quaternion {
  const w = 1 + from.x * to.x + from.y * to.y + from.z * to.z;
  if (w < 1e-9) {
    // opposite: half a turn about any axis across
    return Math.abs(from.z) < 0.5 ? { x: 0, y: 0, z: 1, w: 0 } : { x: 1, y: 0, z: 0, w: 0 };
  }
  const x = from.y * to.z - from.z * to.y;
  const y = from.z * to.x - from.x * to.z;
  const z = from.x * to.y - from.y * to.x;
  const norm = Math.hypot(x, y, z, w);
  return { x: x / norm, y: y / norm, z: z / norm, w: w / norm };
}

function entity(id: string, frame: string, time: Time, parts: Partial<SceneEntity>): SceneEntity {
  return {
    timestamp: time,
    frame_id: frame,
    id,
    lifetime: { sec: 0, nsec: 0 },
    frame_locked: true,
    metadata: [],
    arrows: [],
    cubes: [],
    spheres: [],
    cylinders: [],
    lines: [],
    triangles: [],
    texts: [],
    models: [],
    ...parts,
  };
}

/** An arrow in Hill axes; none where there is no direction. */
function arrow(id: string, time: Time, from: Vector3, along: Vector3, color: Color): SceneEntity {
  const size = length(along);
  if (size === 0) {
    return entity(id, "hill", time, {});
  }
  const head = Math.min(4, size / 2);
  return entity(id, "hill", time, {
    arrows: [
      {
        pose: { position: from, orientation: turning(X_AXIS, times(1 / size, along)) },
        shaft_length: size - head,
        shaft_diameter: 0.8,
        head_length: head,
        head_diameter: 2,
        color,
      },
    ],
  });
}

/** A sphere as three great circles, which hide nothing. */
function shell(id: string, time: Time, radius: number): SceneEntity {
  const circles = [turning(Z_AXIS, X_AXIS), turning(Z_AXIS, { x: 0, y: 1, z: 0 }), UPRIGHT];
  const points: Vector3[] = [];
  for (let i = 0; i < RING_POINTS; i++) {
    const angle = (2 * Math.PI * i) / RING_POINTS;
    points.push({ x: radius * Math.cos(angle), y: radius * Math.sin(angle), z: 0 });
  }
  return entity(id, "hill", time, {
    lines: circles.map((orientation) => ({
      type: 1, // a closed line
      pose: { position: ORIGIN, orientation },
      thickness: 1.5,
      scale_invariant: true,
      points,
      color: SHELL,
      colors: [],
      indices: [],
    })),
  });
}

/** The field of view: a cone from the deputy as deep as the chief is far. */
function camera(time: Time, depth: number, variables: GlobalVariables): SceneEntity {
  const { boresight_x: x, boresight_y: y, boresight_z: z } = variables;
  const width = 2 * depth * Math.tan((variables.half_angle_deg * Math.PI) / 180);
  return entity("field of view", "deputy", time, {
    cylinders: [
      {
        pose: { position: times(depth / 2, { x, y, z }), orientation: turning(Z_AXIS, { x, y, z }) },
        size: { x: width, y: width, z: depth },
        bottom_scale: 0,
        top_scale: 1,
        color: CAMERA,
      },
    ],
  });
}

function spheres(centres: Vector3[], diameter: number, color: Color): Partial<SceneEntity> {
  const size = { x: diameter, y: diameter, z: diameter };
  return { spheres: centres.map((centre) => ({ pose: { position: centre, orientation: UPRIGHT }, size, color })) };
}

function remember(event: Event): void {
  switch (event.topic) {
    case "/deputy/state": {
      const seconds = event.receiveTime.sec + 1e-9 * event.receiveTime.nsec;
      position = vector(event.message.position_m);
      trail = trail.filter((dot) => dot.seconds < seconds);
      trail.push({ seconds, position });
      break;
    }
    case "/deputy/control":
      force = vector(event.message.force_hill_n);
      break;
    case "/guidance":
      target = vector(event.message.target_direction);
      break;
    case "/mission": {
      const angle = event.message.sun_angle_rad;
      const elevation = event.message.sun_elevation_rad ?? 0; // earlier recordings know none
      const level = Math.cos(elevation);
      sun = { x: level * Math.cos(angle), y: level * Math.sin(angle), z: Math.sin(elevation) };
      break;
    }
  }
}

export default function script(event: Event, variables: GlobalVariables): SceneUpdate | undefined {
  remember(event);
  if (!position) {
    return undefined;
  }
  const time = event.receiveTime;
  const radius = variables.inspection_radius_m;
  return {
    deletions: [],
    entities: [
      // a little smaller than the sphere of the points, which lie on it
      entity("body", "chief", time, spheres([ORIGIN], 1.94 * radius, BODY)),
      shell("least distance", time, variables.min_distance_m),
      shell("greatest distance", time, variables.max_distance_m),
      camera(time, length(position), variables),
      arrow("sun", time, times(1.2 * radius, sun), times(2 * radius, sun), SUN),
      arrow("target", time, times(radius, target), times(1.5 * radius, target), TARGET),
      arrow("force", time, position, times(variables.force_arrow_m_per_n, force), FORCE),
      entity("trail", "hill", time, spheres(trail.map((dot) => dot.position), 0.8, TRAIL)),
    ],
  };
}
