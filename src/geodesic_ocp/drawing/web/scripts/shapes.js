// Numbers, surfaces and materials from the data that described.py writes.

const MISSING = -32768;
const CLEAR = "0.08"; // opacity of the middle of a hull
const SIDES = 6; // of a tube, which is a few pixels wide
const RIM = "0.2, 0.75"; // cosines of angles from which its rim fades, and to which

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

// Index of the sample before a time, and how far the time is on the way to the next one, 0 to 1.
function sampleAt(samples, time) {
  let [low, high] = [0, samples.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (samples[middle] <= time) low = middle;
    else high = middle;
  }
  const span = samples[high] - samples[low];
  return [low, span > 0 ? Math.min(1, Math.max(0, (time - samples[low]) / span)) : 0];
}

// A surface, smooth where its triangles share vertices.
function surface({ vertices, triangles, bits }) {
  const corners = new (bits === 16 ? Uint16Array : Uint32Array)(bytes(triangles));
  const made = new THREE.BufferGeometry().setIndex(new THREE.BufferAttribute(corners, 1));
  made.setAttribute("position", new THREE.BufferAttribute(unpacked(vertices), 3));
  made.computeVertexNormals();
  return made;
}

// A tube along points at even distances, with gaps if it is dashed.
function tube(points, radius, dash) {
  const spots = [];
  for (let i = 0; i < points.length; i += 3) {
    spots.push(new THREE.Vector3(points[i], points[i + 1], points[i + 2]));
  }
  const path = new THREE.CatmullRomCurve3(spots);
  // The points are even already: the curve's parameter is its length.
  path.getPointAt = path.getPoint;
  path.getTangentAt = path.getTangent;
  const made = new THREE.TubeGeometry(path, spots.length - 1, radius, SIDES);
  if (dash) {
    const piece = spots[0].distanceTo(spots[1]);
    const [on, off] = dash.map((each) => Math.max(1, Math.round((2.4 * radius * each) / piece)));
    const kept = Array.from(made.index.array).filter(
      (_, i) => Math.floor(i / (6 * SIDES)) % (on + off) < on
    );
    made.setIndex(kept);
  }
  return made;
}

function colour(value) {
  const made = new THREE.Color();
  return Array.isArray(value) ? made.setRGB(...value, THREE.SRGBColorSpace) : made.set(value);
}

function painted(value, opacity = 1) {
  // Triangles of robots' files are not the same way round everywhere.
  const how = { color: colour(value), opacity, transparent: opacity < 1 };
  return new THREE.MeshLambertMaterial({ ...how, side: opacity < 1 ? THREE.FrontSide : THREE.DoubleSide });
}

// Makes a material one of a hull that encloses a surface at some distance [m].
function hull(material, distance) {
  material.transparent = true;
  material.customProgramCacheKey = () => `hull ${distance}`;
  material.onBeforeCompile = (shader) => {
    const moved = `vec3 transformed = position + ${distance.toFixed(6)} * normal;`;
    shader.vertexShader = shader.vertexShader.replace("#include <begin_vertex>", moved);
    if (!material.isMeshPhongMaterial) return;
    // Its rim is seen, and through its middle what is inside.
    const rim = `float facing = abs(dot(normalize(vNormal), normalize(vViewPosition)));
      gl_FragColor.a *= mix(1.0, ${CLEAR}, smoothstep(${RIM}, facing));\n`;
    const last = "#include <dithering_fragment>";
    shader.fragmentShader = shader.fragmentShader.replace(last, rim + last);
  };
  return material;
}
