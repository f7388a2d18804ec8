// One mesh or point cloud of the page, with what can be done to it: exaggerate, show in another look, show its wires.
import {
  BufferAttribute,
  BufferGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  Points,
  RepeatWrapping,
  Texture,
} from "three";
import { LOOKS, WIRE, surfaceMaterial } from "o3dmark/studio";

/** Row i of an (n, 3) array at each of some rows, as an array of floats. */
function gathered(rows, values, width, scale = 1) {
  const result = new Float32Array(rows.length * width);
  for (let i = 0; i < rows.length; i++) {
    for (let k = 0; k < width; k++) result[width * i + k] = scale * values[width * rows[i] + k];
  }
  return result;
}

const largest = (numbers) => numbers.reduce((most, each) => Math.max(most, each), 0);

/** Unit normals of corners: those of a group share the mean over the triangles around them, by area. */
function setNormals(normals, positions, triangles, group) {
  const sums = new Float64Array(3 * (largest(group) + 1));
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const [ux, uy, uz] = [0, 1, 2].map((k) => positions[b + k] - positions[a + k]);
    const [vx, vy, vz] = [0, 1, 2].map((k) => positions[c + k] - positions[a + k]);
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (let k = t; k < t + 3; k++) {
      const at = 3 * group[triangles[k]];
      sums[at] += x;
      sums[at + 1] += y;
      sums[at + 2] += z;
    }
  }
  for (let corner = 0; corner < group.length; corner++) {
    const [x, y, z] = sums.subarray(3 * group[corner], 3 * group[corner] + 3);
    const length = Math.hypot(x, y, z) || 1;
    normals.set([x / length, y / length, z / length], 3 * corner);
  }
}

/** The edges of all triangles, for lines, as pairs of corners; each once, wherever its triangles have corners of their own. */
function edges(triangles, point) {
  const count = largest(point) + 1;
  const corner = new Uint32Array(count); // one of those at a point
  point.forEach((each, number) => (corner[each] = number));
  const pairs = new Float64Array(triangles.length).map((_, t) => {
    const [one, other] = [point[triangles[t]], point[triangles[t % 3 === 2 ? t - 2 : t + 1]]];
    return Math.min(one, other) * count + Math.max(one, other);
  });
  const once = pairs.sort().filter((pair, place) => pair !== pairs[place - 1]);
  const found = new Uint32Array(2 * once.length);
  once.forEach((pair, place) => found.set([corner[Math.floor(pair / count)], corner[pair % count]], 2 * place));
  return found;
}

export class Shape {
  /** told: a mesh as `Drawn.told` has it; first: the Shape that its displacement is from, null for that itself. */
  constructor(told, first, buffers, scene, ramps) {
    Object.assign(this, { told, ramps, factor: 1, moved: told.moved });
    const own = buffers.array(told.positions);
    this.base = told.moved ? first.base : own;
    this.by = told.moved ? own : null;
    this.surface = told.surface;
    this.point = buffers.array(told.surface?.point) ?? new Uint32Array(own.length / 3).map((_, number) => number);
    this.material = surfaceMaterial(scene.studio, !told.surface);
    this.values = Object.fromEntries(
      Object.entries(told.quantities).map(([name, each]) => [name, gathered(this.point, buffers.array(each.values), 1)]),
    );
    this.geometry = this.#geometry(buffers);
    this.object = new Group();
    this.object.add(told.surface ? this.#mesh(buffers) : new Points(this.geometry, this.material));
    this.materials = this.object.children[0].material;
    this.#place();
  }

  #geometry(buffers) {
    const geometry = new BufferGeometry();
    const set = (name, values, width) => values && geometry.setAttribute(name, new BufferAttribute(values, width));
    const colours = buffers.array(this.told.colours);
    const count = this.point.length;
    set("position", new Float32Array(3 * count), 3);
    set("tint", colours ? gathered(this.point, colours, 3, 1 / 255) : new Float32Array(3 * count), 3);
    set("quantity", new Float32Array(count), 1);
    if (this.surface) {
      this.triangles = buffers.array(this.surface.triangles);
      this.group = buffers.array(this.surface.group);
      set("normal", new Float32Array(3 * count), 3);
      set("uv", buffers.array(this.surface.uv) ?? new Float32Array(2 * count), 2);
      geometry.setIndex(new BufferAttribute(this.triangles, 1));
    } else {
      set("normal", buffers.array(this.told.cloud.normals), 3);
    }
    this.hasTint = Boolean(colours);
    return geometry;
  }

  /** A mesh with one material for each picture that it wears. */
  #mesh(buffers) {
    const { counts, pictures } = this.surface;
    if (!pictures.length) return new Mesh(this.geometry, this.material);
    const materials = pictures.map((name) => {
      const material = this.material.clone();
      material.uniforms.hasPicture.value = true;
      material.uniforms.picture.value = this.#picture(buffers.picture(name));
      return material;
    });
    let start = 0;
    counts.forEach((count, number) => {
      this.geometry.addGroup(start, 3 * count, number);
      start += 3 * count;
    });
    return new Mesh(this.geometry, materials);
  }

  #picture(address) {
    const texture = new Texture(new Image());
    texture.flipY = false; // v runs from a picture's first row to its last, as Open3D has it
    texture.wrapS = texture.wrapT = RepeatWrapping;
    const ready = () => {
      texture.needsUpdate = true;
    };
    texture.image.src = address;
    this.loading = Promise.all([this.loading, texture.image.decode().then(ready)]);
    return texture;
  }

  #each(set) {
    for (const material of [this.materials].flat()) set(material.uniforms);
  }

  #place() {
    const position = this.geometry.attributes.position;
    for (let corner = 0; corner < this.point.length; corner++) {
      for (let k = 0; k < 3; k++) {
        const at = 3 * this.point[corner] + k;
        position.array[3 * corner + k] = this.base[at] + (this.by ? this.factor * this.by[at] : 0);
      }
    }
    position.needsUpdate = true;
    if (this.surface) {
      setNormals(this.geometry.attributes.normal.array, position.array, this.triangles, this.group);
      this.geometry.attributes.normal.needsUpdate = true;
    }
    this.geometry.computeBoundingSphere();
  }

  /** Draw the displacement so many times as large as it is, if there is one. */
  exaggerate(factor) {
    if (!this.by || factor === this.factor) return;
    this.factor = factor;
    this.#place();
  }

  /** Show in a look of `LOOKS`; a quantity that the shape lacks shows as clay. */
  show(look) {
    const quantity = this.told.quantities[look];
    if (quantity) {
      this.geometry.attributes.quantity.copyArray(this.values[look]).needsUpdate = true;
    }
    this.#each((uniforms) => {
      uniforms.look.value = LOOKS[look];
      uniforms.hasTint.value = this.hasTint;
      uniforms.hasQuantity.value = Boolean(quantity);
      if (quantity) {
        uniforms.limits.value.set(...quantity.limits);
        uniforms.ramp.value = this.ramps[look];
      }
    });
  }

  /** Show or hide the edges of triangles. */
  wires(shown) {
    if (shown && !this.lines && this.surface) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", this.geometry.attributes.position);
      geometry.setIndex(new BufferAttribute(edges(this.triangles, this.point), 1));
      this.lines = new LineSegments(geometry, new LineBasicMaterial(WIRE));
      this.lines.frustumCulled = false;
      this.object.add(this.lines);
    }
    if (this.lines) this.lines.visible = shown;
  }

  /** Make points as large as they are; `pixels` is the size of one unit at distance one. */
  prepare(pixels) {
    this.#each((uniforms) => {
      uniforms.diameter.value = 2 * pixels * (this.told.cloud?.radius ?? 0);
    });
  }
}
