// Where the cameras stand. Plain numbers, for both engines; it knows neither of them.

/** The 24 vertices of a rhombicuboctahedron as unit directions: the long coordinate runs over x, y, z, the signs over + and -. */
export function rhombicuboctahedron() {
  const long = 1 + Math.SQRT2;
  const length = Math.hypot(1, 1, long);
  const directions = [];
  for (const axis of [2, 0, 1]) {
    for (let signs = 0; signs < 8; signs++) {
      const v = [1, 1, 1].map((one, i) => (((signs >> i) & 1) === 1 ? -1 : 1) * (i === axis ? long : one));
      directions.push(v.map((x) => x / length));
    }
  }
  return directions;
}

/** Vertical field of view of every camera, in degrees. */
export const FIELD_OF_VIEW = 40;

/** The camera that sees the whole sphere `{ center, radius }` from `direction`: eye, target, near and far. */
export function camera(sphere, direction) {
  const radius = sphere.radius > 0 ? sphere.radius : 1;
  const distance = radius / Math.sin((FIELD_OF_VIEW / 2) * (Math.PI / 180));
  return {
    eye: sphere.center.map((x, i) => x + direction[i] * distance),
    target: sphere.center,
    near: Math.max(distance - 1.5 * radius, distance * 0.01),
    far: distance + 1.5 * radius,
  };
}
