// A scene in its place on the page: renderer, light, floor, camera, and labels over it.

const ANGLE = 26; // vertical angle of view [deg]
const STEEP = 0.87; // sine of the elevation from which on shadows hide more than they tell
const MARGIN = 0.88; // share of the view that everything fills

class Pane {
  constructor(element, scene, data, surfaces) {
    this.element = element;
    this.renderer = new THREE.WebGLRenderer({
      antialias: window.devicePixelRatio < 2, // finer pixels need none
      alpha: true,
      preserveDrawingBuffer: true, // for printing
    });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.autoUpdate = false; // the camera does not change shadows
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.canvas = this.renderer.domElement;
    element.append(this.canvas);
    // Browsers keep some sixteen views open, and close the oldest when there are more.
    const text = "The browser has closed this view: it keeps only some views open at once.";
    this.closed = made("p", { class: "playback-missing playback-closed", hidden: "" }, text);
    element.append(this.closed);
    this.canvas.addEventListener("webglcontextlost", () => (this.closed.hidden = false));
    this.canvas.addEventListener("webglcontextrestored", () => (this.closed.hidden = true));

    this.points = [];
    const extremes = unpacked(scene.extremes);
    for (let i = 0; i < extremes.length; i += 3) {
      this.points.push(new THREE.Vector3(...extremes.subarray(i, i + 3)));
    }
    this.box = new THREE.Box3().setFromPoints(this.points);
    this.size = Math.max(0.05, this.box.getSize(new THREE.Vector3()).length() / 2);
    this.drawing = new Drawing(scene, data, surfaces, this.size);
    this.scene = new THREE.Scene().add(this.drawing.root, ...this.lights(data.axes[2][2]), ...this.floor());
    this.labels = this.drawing.labels.map((label) => {
      const element = document.createElement("span");
      element.className = "playback-label";
      this.element.append(element);
      return { ...label, element };
    });

    this.camera = new THREE.PerspectiveCamera(ANGLE, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, element);
    this.controls.rotateSpeed = 0.7;
    this.controls.addEventListener("change", () => (this.stale = true));
    element.style.touchAction = "pan-y"; // fingers scroll the page, and turn the scene sideways
    this.home = new THREE.Vector3();
    this.focusable();
  }

  // The wheel scrolls the page until the pane has the focus; arrows turn the scene once Tab gave it.
  focusable() {
    const { element } = this;
    element.tabIndex = 0;
    element.setAttribute("role", "application");
    const hint = made("span", { class: "playback-hint" }, "click, or hold Ctrl, to zoom");
    element.append(hint);
    element.addEventListener("focus", () => (this.byKeys = element.matches(":focus-visible")));
    element.addEventListener("pointerdown", () => {
      element.focus({ preventScroll: true });
      this.byKeys = false;
    });
    const wheel = ({ ctrlKey }) => {
      this.controls.enableZoom = ctrlKey || document.activeElement === element;
      if (this.controls.enableZoom) return;
      hint.classList.add("playback-seen");
      clearTimeout(this.fading);
      this.fading = setTimeout(() => hint.classList.remove("playback-seen"), 1200);
    };
    element.addEventListener("wheel", wheel, { capture: true, passive: true });
  }

  // By angles [rad] to the right and upwards, and to a multiple of the distance.
  turn(right, up, farther) {
    const { target } = this.controls;
    const { x, y, z } = this.camera.position.clone().sub(target);
    const place = new THREE.Spherical().setFromCartesianCoords(y, z, x);
    place.set(place.radius * farther, place.phi - up, place.theta + right).makeSafe();
    const back = new THREE.Vector3().setFromSpherical(place);
    this.camera.position.set(back.z, back.x, back.y).add(target);
    this.controls.update();
  }

  lights(height) {
    const middle = this.box.getCenter(new THREE.Vector3());
    const far = 2 * this.size;
    const from = (x, y, z, strength) => {
      const light = new THREE.DirectionalLight(0xffffff, Math.PI * strength);
      light.position.set(x, y, z).normalize().multiplyScalar(2 * far).add(middle);
      light.target.position.copy(middle);
      return light;
    };
    const key = from(-0.15, 0.5, 1.6, 0.5);
    key.castShadow = height < STEEP;
    key.shadow.mapSize.set(1024, 1024);
    key.shadow.bias = -0.0005;
    Object.assign(key.shadow.camera, { left: -far, right: far, top: far, bottom: -far, near: 0.01, far: 5 * far });
    const fill = from(1.4, 0.3, 0.5, 0.22);
    const back = from(-1.2, -1.0, 0.6, 0.2);
    const sky = new THREE.HemisphereLight(0xffffff, 0xa8a8a8, 0.42 * Math.PI);
    sky.position.set(0, 0, 1);
    return [key, fill, back, sky].flatMap((light) => (light.target ? [light, light.target] : [light]));
  }

  // A grid that fades away, and the shadow on it.
  floor() {
    this.square = [0.05, 0.1, 0.25, 0.5, 1].find((side) => side > this.size / 6) ?? 2.5;
    const middle = this.box.getCenter(new THREE.Vector3());
    const reach = 3.2 * this.size;
    const level = this.box.min.z - 0.003 * this.size;
    const plane = new THREE.PlaneGeometry(2 * reach, 2 * reach);
    const shadow = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.13 }));
    shadow.receiveShadow = true;
    const grid = new THREE.Mesh(
      plane,
      new THREE.ShaderMaterial({
        transparent: true,
        depthWrite: false,
        uniforms: { square: { value: this.square }, reach: { value: reach }, middle: { value: middle } },
        vertexShader: `
          uniform vec3 middle;
          varying vec2 at, off;
          void main() {
            vec4 world = modelMatrix * vec4(position, 1.0);
            at = world.xy;
            off = world.xy - middle.xy;
            gl_Position = projectionMatrix * viewMatrix * world;
          }`,
        fragmentShader: `
          uniform float square, reach;
          varying vec2 at, off;
          void main() {
            vec2 cell = at / square, step = fwidth(cell);
            vec2 near = abs(fract(cell - 0.5) - 0.5) / step;
            float line = clamp(1.2 - min(near.x, near.y), 0.0, 1.0);
            float crowded = smoothstep(0.45, 0.1, max(step.x, step.y));
            float fade = smoothstep(1.0, 0.15, length(off) / reach);
            gl_FragColor = vec4(0.28, 0.34, 0.42, 0.17 * line * crowded * fade);
          }`,
      })
    );
    [shadow.renderOrder, grid.renderOrder] = [-1, -2];
    for (const each of [shadow, grid]) each.position.set(middle.x, middle.y, level);
    return [grid, shadow];
  }

  // Distance and middle from which everything just fits, seen by a camera with these axes: to the
  // right, up, and back to the observer.
  fit(axes) {
    const [right, up, back] = axes.map((axis) => new THREE.Vector3(...axis));
    const slope = MARGIN * Math.tan(THREE.MathUtils.degToRad(ANGLE / 2));
    const middle = this.box.getCenter(new THREE.Vector3());
    let distance = 0;
    for (const [axis, reach] of [[right, slope * this.camera.aspect], [up, slope]]) {
      // |x - c| <= reach (d - z) for all points: the least d, and the c at which it is possible.
      let [more, less] = [-Infinity, -Infinity];
      for (const point of this.points) {
        const off = point.clone().sub(middle);
        const [x, z] = [off.dot(axis) / reach, off.dot(back)];
        [more, less] = [Math.max(more, x + z), Math.max(less, z - x)];
      }
      distance = Math.max(distance, (more + less) / 2);
      middle.addScaledVector(axis, (reach * (more - less)) / 2);
    }
    return { back, middle, distance: Math.max(distance, 0.2 * this.size) };
  }

  look({ back, middle }, distance) {
    this.home.copy(middle);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(back, distance);
    Object.assign(this.camera, { near: distance / 100, far: distance * 20 }).updateProjectionMatrix();
    this.controls.minDistance = distance / 20;
    this.controls.maxDistance = distance * 6;
    this.controls.update();
    this.stale = true;
  }

  // Look from where another pane looks, relative to the own middle.
  follow(other) {
    const target = other.controls.target.clone().sub(other.home).add(this.home);
    const place = other.camera.position.clone().sub(other.controls.target).add(target);
    if (place.distanceTo(this.camera.position) + target.distanceTo(this.controls.target) < 1e-9) return;
    this.controls.target.copy(target);
    this.camera.position.copy(place);
    this.controls.update();
    this.stale = true;
  }

  resize() {
    const [width, height] = [this.element.clientWidth, this.element.clientHeight];
    const size = `${width} ${height}`;
    if (!width || !height || size === this.drawn) return;
    this.drawn = size;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height);
    this.stale = true;
  }

  show(time) {
    this.drawing.show(time);
    this.changed();
  }

  setLayer(name, on) {
    if (!this.drawing.groups[name] || this.drawing.groups[name].visible === on) return;
    this.drawing.groups[name].visible = on;
    this.changed();
  }

  changed() {
    this.renderer.shadowMap.needsUpdate = true;
    this.stale = true;
  }

  render() {
    if (this.renderer.getContext().isContextLost()) return;
    this.renderer.render(this.scene, this.camera);
    this.stale = false;
    const placed = [];
    for (const label of this.labels.sort((a, b) => a.rank() - b.rank())) {
      label.element.hidden = !this.placed(label, placed);
    }
  }

  // Puts a label at its object, unless that is not seen or another label is there.
  placed({ at, below, text, element }, others) {
    let shown = true;
    at.traverseAncestors((parent) => (shown = shown && parent.visible));
    const spot = at.getWorldPosition(new THREE.Vector3()).project(this.camera);
    if (!shown || spot.z > 1) return false;
    const x = ((1 + spot.x) / 2) * this.element.clientWidth;
    const y = ((1 - spot.y) / 2) * this.element.clientHeight + (below ? 4 : -24);
    const wide = 8 * text().length + 14; // about as wide as it is written
    if (others.some((o) => x < o.x + o.wide && o.x < x + wide && Math.abs(y - o.y) < 19)) return false;
    others.push({ x, y, wide });
    if (element.textContent !== text()) element.textContent = text();
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    return true;
  }

  // Name of what is seen at a place on the screen, "" if it has none.
  named({ clientX, clientY }) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(
      new THREE.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height),
      this.camera
    );
    const meshes = [];
    this.drawing.root.traverseVisible((object) => {
      if (object.isMesh && object.userData.name) meshes.push(object);
    });
    return ray.intersectObjects(meshes)[0]?.object.userData.name ?? "";
  }
}
