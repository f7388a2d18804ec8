// Pictures of GLB files by three.js in a headless Chromium: FOLDER/ROW-COLUMN.png, a row a file and a column a time.
//
//     node draw.mjs CHROMIUM FOLDER WIDTH HEIGHT TIME,TIME,... FILE...
//
// All are seen from where the first file at the first time fills the picture. The page reaches nothing but these files
// and three.js.
import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const LONGEST = 60_000; // ms, for each step
const FLAGS = [
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--no-first-run",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
];
const HERE = fileURLToPath(new URL(".", import.meta.url));
const SITE = "http://proof.invalid"; // never asked for: every request is answered below

const [browserPath, folder, width, height, times, ...files] = process.argv.slice(2);

async function answer(route) {
  const path = new URL(route.request().url()).pathname;
  const [, first, rest] = /^\/([^/]*)\/?(.*)$/.exec(path);
  const found = { "": "page.html", three: join("node_modules/three", rest), page: rest }[first];
  const file = first === "file" ? files[Number(rest)] : found && join(HERE, found);
  if (!file || rest.includes("..")) {
    return route.abort();
  }
  const type = { js: "text/javascript", html: "text/html" }[file.split(".").at(-1)] ?? "application/octet-stream";
  return route.fulfill({ body: await readFile(file), contentType: type });
}

const browser = await chromium.launch({ executablePath: browserPath, args: FLAGS, timeout: LONGEST });
try {
  const page = await browser.newPage({ viewport: { width: Number(width), height: Number(height) } });
  page.setDefaultTimeout(LONGEST);
  page.on("pageerror", (error) => console.error(String(error)));
  await page.route("**/*", answer);
  await page.goto(`${SITE}/`);
  await page.waitForFunction(() => "draw" in window);
  for (const row of files.keys()) {
    for (const [column, time] of times.split(",").entries()) {
      const picture = await page.evaluate(([url, at]) => window.draw(url, at), [`/file/${row}`, Number(time)]);
      await writeFile(join(folder, `${row}-${column}.png`), Buffer.from(picture.split(",")[1], "base64"));
    }
  }
  console.log(JSON.stringify({ browser: browser.version(), ...(await page.evaluate(() => window.about())) }));
} finally {
  await browser.close();
}
