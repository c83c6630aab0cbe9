// Numbers and surfaces from the data that described.py writes.

// An overlay that covers something exactly is behind all of it, not in spots.
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
const MISSING = -32768;
const CREASE = Math.cos((38 * Math.PI) / 180); // faces that differ by less look like one

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

// Rows of numbers, one after the other.
function unpacked({ middle, step, data }) {
  const codes = new Int16Array(bytes(data));
  const count = middle.length;
  return Float32Array.from(codes, (code, i) =>
    code === MISSING ? NaN : middle[i % count] + step[i % count] * code
  );
}

// A surface whose edges are crisp where faces meet at an angle, and smooth elsewhere.
function surface(body) {
  const places = unpacked(body.vertices);
  const corners = new (body.bits === 16 ? Uint16Array : Uint32Array)(bytes(body.triangles));
  const faces = new Float32Array(corners.length); // normals, as long as twice the area
  const around = Array.from({ length: places.length / 3 }, () => []);
  for (let i = 0; i < corners.length; i += 3) {
    const [a, b, c] = [3 * corners[i], 3 * corners[i + 1], 3 * corners[i + 2]];
    const u = [0, 1, 2].map((k) => places[b + k] - places[a + k]);
    const v = [0, 1, 2].map((k) => places[c + k] - places[a + k]);
    faces[i] = u[1] * v[2] - u[2] * v[1];
    faces[i + 1] = u[2] * v[0] - u[0] * v[2];
    faces[i + 2] = u[0] * v[1] - u[1] * v[0];
    for (let k = 0; k < 3; k++) around[corners[i + k]].push(i);
  }
  const size = (i) => Math.hypot(faces[i], faces[i + 1], faces[i + 2]);
  const points = new Float32Array(3 * corners.length);
  const normals = new Float32Array(3 * corners.length);
  corners.forEach((corner, at) => {
    const own = at - (at % 3);
    for (let k = 0; k < 3; k++) points[3 * at + k] = places[3 * corner + k];
    for (const face of around[corner]) {
      let along = 0;
      for (let k = 0; k < 3; k++) along += faces[own + k] * faces[face + k];
      if (face !== own && along < CREASE * size(own) * size(face)) continue;
      for (let k = 0; k < 3; k++) normals[3 * at + k] += faces[face + k];
    }
    const length = Math.hypot(...normals.subarray(3 * at, 3 * at + 3)) || 1;
    for (let k = 0; k < 3; k++) normals[3 * at + k] /= length;
  });
  const made = new MeshCat.THREE.BufferGeometry();
  made.setAttribute("position", new MeshCat.THREE.BufferAttribute(points, 3));
  made.setAttribute("normal", new MeshCat.THREE.BufferAttribute(normals, 3));
  return made;
}

// A tube along points at even distances, with gaps if it is dashed.
function tube(points, radius, dash) {
  const { THREE } = MeshCat;
  const spots = [];
  for (let i = 0; i < points.length; i += 3) {
    spots.push(new THREE.Vector3(points[i], points[i + 1], points[i + 2]));
  }
  const path = new THREE.CatmullRomCurve3(spots);
  // The points are even already: the curve's parameter is its length.
  path.getPointAt = path.getPoint;
  path.getTangentAt = path.getTangent;
  const pieces = 2 * (spots.length - 1);
  const made = new THREE.TubeGeometry(path, pieces, radius, 8);
  if (dash) {
    const piece = spots[0].distanceTo(spots[1]) / 2;
    const [on, off] = dash.map((each) => Math.max(1, Math.round((2.4 * radius * each) / piece)));
    const kept = Array.from(made.index.array).filter(
      (_, i) => Math.floor(i / 48) % (on + off) < on
    );
    made.setIndex(kept);
  }
  return made;
}

function colour(value) {
  const made = Array.isArray(value) ? new MeshCat.THREE.Color(...value) : new MeshCat.THREE.Color(value);
  return made.convertSRGBToLinear();
}

function painted(value, opacity = 1) {
  return new MeshCat.THREE.MeshStandardMaterial({
    color: colour(value),
    roughness: 0.62,
    metalness: 0.04,
    opacity,
    transparent: opacity < 1,
    ...(opacity < 1 ? BEHIND : {}),
  });
}
