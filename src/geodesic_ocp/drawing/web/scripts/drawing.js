// What one scene consists of, as objects of three.js with functions that move them.

const FAINT = 0.3; // and of lines behind bodies

class Drawing {
  // surfaces: those of data.bodies; size: of the scene [m], by which lines are as wide.
  constructor(scene, data, surfaces, size) {
    this.root = new THREE.Group();
    this.groups = {}; // by layer
    this.labels = []; // {at: object, below or above it, functions text and rank: lower comes first}
    this.moving = []; // functions of sample and fraction
    this.samples = new Float64Array(bytes(scene.time));
    this.surfaces = surfaces;
    this.roles = data.roles;
    this.colours = data.colours;
    this.width = 0.0055 * size;
    this.overlays = 0;
    for (const kind of ["actor", "trail", "solid", "frame", "ellipsoid", "gap", "cloud"]) {
      for (const item of scene[`${kind}s`]) this[kind](item);
    }
  }

  layer(name) {
    if (!this.groups[name]) {
      this.groups[name] = new THREE.Group();
      this.root.add(this.groups[name]);
    }
    return this.groups[name];
  }

  // Move everything to a time, between two samples if need be.
  show(time) {
    const [low, fraction] = sampleAt(this.samples, time);
    for (const move of this.moving) move(low, fraction);
  }

  // Rows of numbers, interpolated: a function of sample and fraction that returns one row.
  rows(data) {
    const values = unpacked(data);
    const count = data.middle.length;
    const last = values.length / count - 1;
    const row = new Float32Array(count);
    return (index, fraction) => {
      const [a, b] = [Math.min(index, last) * count, Math.min(index + 1, last) * count];
      for (let k = 0; k < count; k++) row[k] = (1 - fraction) * values[a + k] + fraction * values[b + k];
      return row;
    };
  }

  placed(object, positions) {
    const place = this.rows(positions);
    this.moving.push((index, fraction) => object.position.fromArray(place(index, fraction)));
    return object;
  }

  posed(object, { positions, turns }) {
    const values = unpacked(turns);
    const last = values.length / 4 - 1;
    const turn = [0, 0, 0, 1];
    this.moving.push((index, fraction) => {
      const [a, b] = [4 * Math.min(index, last), 4 * Math.min(index + 1, last)];
      THREE.Quaternion.slerpFlat(turn, 0, values, a, values, b, fraction);
      object.quaternion.fromArray(turn).normalize();
    });
    return this.placed(object, positions);
  }

  mesh(shape, material, name, castShadow = true) {
    const made = Object.assign(new THREE.Mesh(shape, material), { castShadow });
    made.userData.name = name;
    return made;
  }

  actor(actor) {
    // So that an overlay is not in spots on what it covers, such as another overlay.
    if (actor.translucent) this.overlays += 1;
    const around = (0.35 + 0.2 * this.overlays) * this.width;
    const hidden = hull(new THREE.MeshBasicMaterial({ colorWrite: false }), around);
    const materials = {};
    for (const link of actor.links) {
      const group = this.posed(new THREE.Group(), link);
      const name = actor.name === link.name ? link.name : `${actor.name}: ${link.name}`;
      for (const part of link.parts) {
        const paint = actor.role ? this.roles[actor.role].body : part.colour;
        const overlay = () => hull(new THREE.MeshPhongMaterial({ color: colour(paint), shininess: 10 }), around);
        materials[paint] ??= actor.translucent ? overlay() : painted(paint);
        const body = this.mesh(this.surfaces[part.body], materials[paint], name, !actor.translucent);
        if (actor.translucent) {
          // Its own depth comes first, so that only its outside is seen.
          const depth = new THREE.Mesh(body.geometry, hidden);
          [depth.renderOrder, body.renderOrder] = [1, 2];
          group.add(depth);
        }
        group.add(body);
      }
      this.layer(actor.layer).add(group);
    }
  }

  // A line, and faintly where bodies hide it.
  seen(shape, paint, name, order) {
    const group = new THREE.Group();
    const front = new THREE.MeshBasicMaterial({ color: colour(paint) });
    const behind = new THREE.MeshBasicMaterial({
      ...{ color: colour(paint), opacity: FAINT, transparent: true },
      ...{ depthFunc: THREE.GreaterDepth, depthWrite: false },
    });
    const [line, faint] = [new THREE.Mesh(shape, front), new THREE.Mesh(shape, behind)];
    line.userData.name = name;
    faint.renderOrder = order;
    return group.add(line, faint);
  }

  trail(trail) {
    const { colour: paint, dash } = this.roles[trail.role];
    const points = unpacked(trail.points);
    const group = this.layer(trail.layer);
    if (points.length > 3) {
      group.add(this.seen(tube(points, this.width / 2, dash), paint, trail.name, 3));
    }
    if (trail.dot) {
      const ball = new THREE.SphereGeometry(2.2 * this.width, 24, 16);
      group.add(this.placed(this.seen(ball, paint, trail.name, 4), trail.dot));
    }
  }

  solid(solid) {
    const material = painted(this.colours.obstacle, solid.unbounded ? 0.22 : 0.58);
    if (solid.unbounded) material.side = THREE.DoubleSide;
    material.depthWrite = false;
    const shape = this.surfaces[solid.body];
    const made = this.mesh(shape, material, solid.name, !solid.unbounded);
    made.renderOrder = 5;
    const edges = new THREE.LineSegments(
      new THREE.EdgesGeometry(shape, 30),
      new THREE.LineBasicMaterial({ color: colour(this.colours.obstacle), transparent: true, opacity: 0.7 })
    );
    this.layer(solid.layer).add(made, edges);
  }

  frame(frame) {
    const group = this.posed(new THREE.Group(), frame);
    const length = 22 * this.width;
    ["x", "y", "z"].map((axis) => this.colours[axis]).forEach((paint, axis) => {
      const shape = new THREE.CylinderGeometry(this.width / 1.6, this.width / 1.6, length, 12);
      shape.translate(0, length / 2, 0);
      if (axis === 0) shape.rotateZ(-Math.PI / 2);
      if (axis === 2) shape.rotateX(Math.PI / 2);
      group.add(this.seen(shape, paint, `${frame.name}: ${"xyz"[axis]}`, 4));
    });
    this.layer(frame.layer).add(group);
    this.labels.push({ at: group, below: true, text: () => frame.name, rank: () => -Infinity });
  }

  ellipsoid(ellipsoid) {
    const material = painted(this.colours.ellipsoid, 0.42);
    const made = this.mesh(new THREE.SphereGeometry(1, 48, 32), material, ellipsoid.name);
    made.renderOrder = 6;
    made.matrixAutoUpdate = false;
    const [place, axes] = [this.rows(ellipsoid.positions), this.rows(ellipsoid.axes)];
    const columns = [0, 1, 2].map(() => new THREE.Vector3());
    this.moving.push((index, fraction) => {
      const row = axes(index, fraction);
      columns.forEach((column, axis) => column.fromArray(row, 3 * axis));
      made.matrix.makeBasis(...columns).setPosition(...place(index, fraction));
      made.matrixWorldNeedsUpdate = true;
    });
    this.layer(ellipsoid.layer).add(made);
  }

  gap(gap) {
    const group = new THREE.Group();
    const material = new THREE.MeshBasicMaterial();
    const ball = new THREE.SphereGeometry(0.9 * this.width, 16, 12);
    const rod = new THREE.CylinderGeometry(this.width / 3, this.width / 3, 1, 10);
    const [line, ...balls] = [rod, ball, ball].map((shape) => new THREE.Mesh(shape, material));
    const middle = new THREE.Object3D();
    const [distance, ends] = [this.rows(gap.distances), this.rows(gap.ends)];
    const up = new THREE.Vector3(0, 1, 0);
    let now = 0;
    this.moving.push((index, fraction) => {
      [now] = distance(index, fraction);
      const row = ends(index, fraction);
      balls.forEach((each, end) => each.position.fromArray(row, 3 * end));
      const along = balls[1].position.clone().sub(balls[0].position);
      middle.position.copy(balls[0].position).addScaledVector(along, 0.5);
      line.position.copy(middle.position);
      line.scale.set(1, Math.max(along.length(), 1e-6), 1);
      line.quaternion.setFromUnitVectors(up, along.length() > 0 ? along.normalize() : up);
      material.color.copy(colour(now < 0 ? this.colours.overlap : this.colours.gap));
    });
    for (const each of [line, ...balls]) each.userData.name = gap.name;
    this.layer(gap.layer).add(group.add(line, ...balls, middle));
    const text = () => `${(1000 * now).toFixed(0)} mm`.replace("-", "−");
    this.labels.push({ at: middle, below: false, text, rank: () => now });
  }

  cloud(cloud) {
    const place = this.rows(cloud.positions);
    const ball = new THREE.SphereGeometry(1.6 * this.width, 16, 12);
    const material = painted(cloud.role ? this.roles[cloud.role].colour : this.colours.marker);
    const balls = cloud.labels.map((label) => this.mesh(ball, material, label, false));
    this.moving.push((index, fraction) => {
      const row = place(index, fraction);
      balls.forEach((each, i) => {
        each.visible = !Number.isNaN(row[3 * i]);
        if (each.visible) each.position.fromArray(row, 3 * i);
      });
    });
    this.layer(cloud.layer).add(...balls);
  }
}
