// The page: what is shown, in which look, how exaggerated; every control is a form element, so keys reach all of them.
import { Buffers } from "o3dmark/buffers";
import { Shape } from "o3dmark/shape";
import { Stage } from "o3dmark/stage";
import { rampTexture } from "o3dmark/studio";

const scene = JSON.parse(document.getElementById("scene").textContent);
const buffers = new Buffers(scene.buffers);
const byId = (id) => document.getElementById(id);
const clone = (id) => byId(id).content.firstElementChild.cloneNode(true);

/** A radio button under a label, in a group. */
function choice(group, value, label, chosen) {
  const made = clone("choice");
  const input = made.querySelector("input");
  Object.assign(input, { name: group, value, checked: chosen });
  made.querySelector("span").textContent = label;
  byId(group).append(made);
}

/** A number with few digits, the way people write it. */
function number(value) {
  const text = Number(value.toPrecision(3));
  return Math.abs(text) >= 1e-3 && Math.abs(text) < 1e5 ? String(text) : text === 0 ? "0" : text.toExponential();
}

/** The colours of a ramp as a gradient. */
function gradient(rgba) {
  const stops = Array.from({ length: 17 }, (_, i) => rgba.subarray(4 * 15 * i, 4 * 15 * i + 3).join(" "));
  return `linear-gradient(to right, ${stops.map((stop) => `rgb(${stop})`).join(", ")})`;
}

function makeFigures() {
  return scene.meshes.map((mesh, place) => {
    const figure = clone("figure");
    figure.querySelector("b").textContent = mesh.name;
    figure.setAttribute("aria-label", `${place + 1} ${mesh.name}`);
    byId("stage").append(figure);
    return figure;
  });
}

function legend(figure, mesh, look, ramps) {
  const bar = figure.querySelector(".legend");
  const quantity = mesh.quantities[look];
  const wanted = look in ramps;
  bar.hidden = !quantity;
  figure.querySelector(".without").hidden = !wanted || Boolean(quantity);
  const alone = look === "displacement" && mesh === scene.meshes[0];
  figure.querySelector(".without").textContent = alone ? "what the others are compared with" : `no ${look} to show`;
  if (!quantity) return;
  const [low, high] = quantity.limits;
  const { beyond } = quantity;
  bar.querySelector(".ramp").style.backgroundImage = gradient(ramps[look]);
  bar.querySelector(".low").textContent = (["min", "both"].includes(beyond) ? "≤ " : "") + number(low);
  bar.querySelector(".middle").textContent = number((low + high) / 2);
  bar.querySelector(".high").textContent = (["max", "both"].includes(beyond) ? "≥ " : "") + number(high);
  bar.querySelector(".label").textContent = quantity.label;
}

function start() {
  const ramps = Object.fromEntries(Object.entries(scene.ramps).map(([name, told]) => [name, buffers.array(told)]));
  const textures = Object.fromEntries(Object.entries(ramps).map(([name, rgba]) => [name, rampTexture(rgba)]));
  const shapes = [];
  for (const told of scene.meshes) shapes.push(new Shape(told, shapes[0] ?? null, buffers, scene, textures));
  const figures = makeFigures();
  const places = figures.map((figure) => figure.querySelector(".place"));
  const stage = new Stage(byId("stage"), byId("canvas"), places, shapes, scene);
  const narrow = matchMedia("(max-width: 640px)").matches && scene.meshes.length > 1;
  const form = byId("controls");
  scene.looks.forEach(([name, words]) => choice("look", name, words, name === scene.look));
  choice("shown", "all", "Side by side", !narrow);
  scene.meshes.forEach(({ name }, place) => choice("shown", String(place), `${place + 1} ${name}`, narrow && !place));
  byId("shown").hidden = scene.meshes.length < 2;
  byId("exaggeration").hidden = !scene.factors.length;
  Object.assign(byId("factor"), { max: Math.max(scene.factors.length - 1, 0), value: scene.factors.indexOf(scene.factor) });
  byId("rounding").textContent = scene.rounding.toExponential(0);

  function update() {
    const { look, shown } = Object.fromEntries(new FormData(form));
    const factor = scene.factors[byId("factor").value] ?? 1;
    byId("times").textContent = factor === 0 ? "none of it" : factor === 1 ? "as it is" : `× ${factor}`;
    byId("factor").setAttribute("aria-valuetext", byId("times").textContent);
    shapes.forEach((shape, place) => {
      shape.exaggerate(factor);
      shape.show(look);
      shape.wires(byId("wires").checked);
      figures[place].hidden = shown !== "all" && shown !== String(place);
      legend(figures[place], scene.meshes[place], look, ramps);
      const drawn = shape.moved && factor !== 1 ? `; displacement drawn ${factor} times as large` : "";
      const caption = figures[place].querySelector("small");
      caption.textContent = caption.title = scene.meshes[place].caption + drawn;
    });
    stage.draw();
  }

  form.addEventListener("input", update);
  byId("reset").addEventListener("click", () => stage.reset());
  byId("dark").checked = matchMedia("(prefers-color-scheme: dark)").matches;
  byId("dark").addEventListener("change", ({ target }) => {
    document.documentElement.style.colorScheme = target.checked ? "dark" : "light";
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !/^\d$/.test(event.key)) return;
    const input = form.querySelector(`[name=shown][value="${event.key === "0" ? "all" : event.key - 1}"]`);
    if (input) input.click();
  });
  update();
  return Promise.all(shapes.map((shape) => shape.loading)).then(() => stage.draw());
}

try {
  await start();
  byId("stage").addEventListener("drawn", () => (document.documentElement.dataset.state = "drawn"), { once: true });
} catch (error) {
  byId("failure").hidden = false;
  byId("failure").querySelector("span").textContent = error.message;
  document.documentElement.dataset.state = "failed";
}
