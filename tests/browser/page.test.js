// The pages of `beamcast view` and `beamcast check --html`, in a headless Chromium: what is drawn, what moves, what is asked of
// the network (nothing), and what is there without WebGL2. Needs BEAMCAST (the program) and CHROMIUM (default: the Debian
// package's); screenshots go to SCREENSHOTS, if set.

import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { mkdtempSync, mkdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const BEAMCAST = path.resolve(ROOT, process.env.BEAMCAST ?? "target/release/beamcast");
const QUIET = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
];
const SOFTWARE_GL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const NO_GL = ["--disable-3d-apis", "--disable-webgl", "--disable-webgl2"];
const HOSTILE = "</script><img src=x onerror=\"document.title='taken'\">";
const HEBREW = "קיר צפוני \u202e<b>";

let folder, withGl, withoutGl;
const pages = {};

// A room of two walls, 10 m ahead and 4 m to the left, whose names are anything but names.
function writeScene() {
    const wall = [10, -20, -20, 10, 20, -20, 10, 0, 30], side = [-30, 4, -20, 30, 4, -20, 0, 4, 30];
    // z up to glTF's y up.
    const gltf = (p) => [p[0], p[2], -p[1]];
    const corners = [wall, side].flatMap((w) => [0, 3, 6].flatMap((i) => gltf(w.slice(i, i + 3))));
    writeFileSync(path.join(folder, "walls.bin"), Buffer.from(new Float32Array(corners).buffer));
    const bounds = (from) => [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => f(...[0, 3, 6].map((i) => corners[from + i + k]))));
    const accessor = (from) => ({ bufferView: 0, byteOffset: 4 * from, componentType: 5126, count: 3, type: "VEC3", min: bounds(from)[0], max: bounds(from)[1] });
    const mesh = (at) => ({ primitives: [{ attributes: { POSITION: at } }] });
    writeFileSync(path.join(folder, "walls.gltf"), JSON.stringify({
        asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0, 1] }],
        nodes: [{ mesh: 0, name: HOSTILE, extras: { label: 3 } }, { mesh: 1, name: HEBREW, extras: { label: 5 } }],
        meshes: [mesh(0), mesh(1)], accessors: [accessor(0), accessor(9)],
        bufferViews: [{ buffer: 0, byteLength: 72 }], buffers: [{ uri: "walls.bin", byteLength: 72 }],
    }));
    writeFileSync(path.join(folder, "walls.toml"), `scene = "walls.gltf"
[[sensor]]
name = "top"
[sensor.rotating]
elevations_deg = { from = 15.0, to = -15.0, count = 31 }
columns = 360
rate_hz = 10.0
[output]
dir = "out"
[[expect]]
name = "<b>many</b> ${HOSTILE.replaceAll('"', "")}"
returns = { at_least = 0.99 }
`);
}

// A recorded sequence of a sensor that drives 1 m a frame past a car, with tables of its poses and of the car's boxes.
const MOMENTS = 12;
function writeSequence(run) {
    const job = readFileSync(path.join(folder, "walls.toml"), "utf8").replace("rate_hz = 10.0", "rate_hz = 10.0\n[sequence]\nframes = " + MOMENTS);
    // A pattern that does not repeat sees something else in each frame.
    const prisms = job.replace(/\[sensor\.rotating\][^[]*/, `[sensor.risley]
prisms = [{ rate_hz = -121.6, wedge_deg = 18.7, index = 1.51 }, { rate_hz = 77.7, wedge_deg = 18.0, index = 1.51 }]
beams_deg = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
pulse_rate_hz = 20000.0
rate_hz = 10.0
`);
    writeFileSync(path.join(folder, "sequence.toml"), prisms);
    run("scan", "sequence.toml", "--out", "sequence");
    const numbers = [...Array(MOMENTS).keys()];
    const header = "frame,sensor,t_s,x_m,y_m,z_m,qx,qy,qz,qw,body_x_m,body_y_m,body_z_m,body_qx,body_qy,body_qz,body_qw";
    const pose = (k) => `${k},top,${k / 10},${k},0,1.8,0,0,0,1,${k},0,0,0,0,0,1`;
    writeFileSync(path.join(folder, "sequence/poses.csv"), [header, ...numbers.map(pose), ""].join("\n"));
    const car = (k) => JSON.stringify({
        frame: k, sensor: "top", name: HOSTILE, label: 4, length_m: 4, width_m: 2, height_m: 1.5,
        in_world: { centre_m: [9 + k / 2, -2, 0.7], quaternion_xyzw: [0, 0, 0, 1] },
    });
    writeFileSync(path.join(folder, "sequence/boxes.jsonl"), numbers.map(car).join("\n"));
    const file = path.join(folder, "sequence/manifest.json");
    const manifest = JSON.parse(readFileSync(file, "utf8"));
    manifest.outputs = manifest.outputs.filter((o) => !["poses.csv", "boxes.jsonl"].includes(o.path));
    manifest.outputs.push({ path: "poses.csv" }, { path: "boxes.jsonl" });
    writeFileSync(file, JSON.stringify(manifest));
}

before(async () => {
    folder = mkdtempSync(path.join(tmpdir(), "beamcast-browser-"));
    writeScene();
    const run = (...args) => execFileSync(BEAMCAST, args, { cwd: folder, stdio: "pipe" });
    for (const [name, job] of [["walls", "walls.toml"], ["street", path.join(ROOT, "configs/street_128.toml")], ["camera", path.join(ROOT, "configs/warehouse_depth.toml")]]) {
        pages[name] = path.join(folder, name + ".html");
        run("view", job, "-o", pages[name]);
    }
    pages.large = path.join(folder, "large.html");
    const large = readFileSync(path.join(folder, "walls.toml"), "utf8").replace("count = 31", "count = 300").replace("columns = 360", "columns = 15000");
    writeFileSync(path.join(folder, "large.toml"), large);
    run("view", "large.toml", "-o", pages.large);
    writeSequence(run);
    pages.sequence = path.join(folder, "sequence.html");
    run("view", "sequence", "-o", pages.sequence);
    // A baseline, and a run with the sensor 20 cm nearer to the wall.
    const environment = { ...process.env, CI: "" };
    spawnSync(BEAMCAST, ["check", "--accept", "walls.toml"], { cwd: folder, env: environment });
    pages.check = path.join(folder, "check.html");
    const moved = ["--set", "sensor.top.pose.position_m=[0.2, 0.0, 0.0]"];
    const check = spawnSync(BEAMCAST, ["check", "walls.toml", ...moved, "--html", pages.check], { cwd: folder, env: environment });
    assert.equal(check.status, 1, String(check.stderr));
    const launch = (more) => chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: [...QUIET, ...more] });
    [withGl, withoutGl] = await Promise.all([launch(SOFTWARE_GL), launch(NO_GL)]);
});

after(async () => {
    await withGl?.close();
    await withoutGl?.close();
    if (folder) rmSync(folder, { recursive: true });
});

// Opens a page, waits for its frames, and holds it to silence: no error, no request but for itself.
async function open(t, file, { browser = withGl, ...options } = {}) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 2400 }, ...options });
    const page = await context.newPage();
    const complaints = [], requests = [];
    page.on("console", (message) => { if (message.type() === "error") complaints.push(message.text()); });
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("dialog", (dialog) => { complaints.push("a dialog"); dialog.dismiss(); });
    context.on("request", (request) => requests.push(request.url()));
    const url = pathToFileURL(file).href;
    const start = Date.now();
    await page.goto(url);
    await page.waitForFunction(() => [...document.querySelectorAll("section.view")].every((s) => s.getAttribute("aria-busy") === "false"));
    const seconds = (Date.now() - start) / 1000;
    t.after(async () => {
        await context.close();
        assert.deepEqual(complaints, []);
        assert.deepEqual([...new Set(requests)], [url]);
    });
    await settle(page);
    return { page, seconds };
}

// Until what was asked to be drawn is drawn.
const settle = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

// The pixels of a canvas that are not the colour of no return, and a sum that tells pictures apart.
const drawn = (page, selector) => page.evaluate((selector) => {
    const canvas = document.querySelector(selector);
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let lit = 0, sum = 0;
    const colours = new Set();
    for (let i = 0; i < data.length; i += 4) {
        const colour = data[i] << 16 | data[i + 1] << 8 | data[i + 2];
        if (colour !== 0x101014) lit++;
        colours.add(colour);
        sum = (Math.imul(sum, 31) + colour) | 0;
    }
    return { lit, sum, colours: colours.size, pixels: data.length / 4 };
}, selector);

const choose = (page, channel) => page.locator(".controls select").selectOption({ label: channel });

const PICTURE = "canvas[data-picture=run]", CLOUD = "canvas.cloud";

async function shoot(page, name) {
    if (!process.env.SCREENSHOTS) return;
    mkdirSync(process.env.SCREENSHOTS, { recursive: true });
    await page.screenshot({ path: path.join(process.env.SCREENSHOTS, name + ".png"), fullPage: true });
}

test("pictures and clouds are drawn, each channel in its own colours", async (t) => {
    const { page } = await open(t, pages.camera);
    const picture = await drawn(page, PICTURE), cloud = await drawn(page, CLOUD);
    assert.equal(picture.pixels, 640 * 480);
    assert.ok(picture.lit > 200_000 && picture.colours > 100, JSON.stringify(picture));
    assert.ok(cloud.lit > 20_000 && cloud.colours > 100, JSON.stringify(cloud));
    const channels = await page.locator(".controls option").allTextContents();
    assert.deepEqual(channels, ["range", "depth", "intensity", "normal", "instance", "label", "time", "cause"]);
    const seen = new Set([picture.sum]), clouds = new Set([cloud.sum]);
    for (const channel of channels.slice(1)) {
        await choose(page, channel);
        await settle(page);
        const now = await drawn(page, PICTURE);
        // Every pixel has a cause, also one without a return.
        if (channel === "cause") assert.ok(now.lit >= picture.lit, channel);
        else assert.equal(now.lit, picture.lit, channel);
        seen.add(now.sum);
        clouds.add((await drawn(page, CLOUD)).sum);
    }
    assert.deepEqual([seen.size, clouds.size], [channels.length, channels.length]);
});

test("a cloud turns, zooms and moves by mouse, keys and fingers", async (t) => {
    const { page } = await open(t, pages.walls, { hasTouch: true });
    const canvas = page.locator(CLOUD);
    await canvas.scrollIntoViewIfNeeded();
    const first = await drawn(page, CLOUD);
    assert.ok(first.lit > 1000, JSON.stringify(first));
    const box = await canvas.boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    let before = first;
    const changes = async (what) => {
        await settle(page);
        const now = await drawn(page, CLOUD);
        assert.notEqual(now.sum, before.sum, what);
        assert.ok(now.lit > 500, what + ": " + JSON.stringify(now));
        before = now;
    };
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 120, y + 40, { steps: 4 });
    await page.mouse.up();
    await changes("drag");
    await page.mouse.move(x - 50, y);
    await settle(page);
    assert.equal((await drawn(page, CLOUD)).sum, before.sum, "a mouse without a button turns nothing");
    await page.mouse.wheel(0, -300);
    await changes("wheel");
    await page.keyboard.down("Shift");
    await page.mouse.down();
    await page.mouse.move(x + 60, y, { steps: 2 });
    await page.mouse.up();
    await page.keyboard.up("Shift");
    await changes("shift and drag");
    await canvas.focus();
    for (const key of ["ArrowLeft", "ArrowUp", "+", "-", "Shift+ArrowRight"]) {
        await page.keyboard.press(key);
        await changes(key);
    }
    const device = await page.context().newCDPSession(page);
    const touch = (type, ...points) => device.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    await touch("touchStart", [x - 20, y], [x + 20, y]);
    await touch("touchMove", [x - 90, y], [x + 90, y]);
    await touch("touchEnd");
    await changes("two fingers");
    await touch("touchStart", [x, y]);
    await touch("touchMove", [x + 70, y + 10]);
    await touch("touchEnd");
    await changes("one finger");
    await page.keyboard.press("0");
    await settle(page);
    assert.equal((await drawn(page, CLOUD)).sum, first.sum, "0 shows what was shown first");
});

test("the value under the pointer is the value of the frame", async (t) => {
    const { page } = await open(t, pages.walls);
    const canvas = page.locator(PICTURE);
    const box = await canvas.boundingBox();
    // Row 15 of 31 is level, column 180 of 360 looks straight ahead: 10 m.
    await page.mouse.move(box.x + box.width * 180.5 / 360, box.y + box.height * 15.5 / 31);
    const values = page.locator("output.values");
    assert.match(await values.textContent(), /row 15, column 180: range 10\.0000 m, intensity 1\.0+, normal \(-1\.00, 0\.00, 0\.00\), instance 1 /);
    // Columns go clockwise: 90 further left, azimuth 90, is the wall at 4 m.
    await canvas.focus();
    for (let i = 0; i < 9; i++) await page.keyboard.press("Shift+ArrowLeft");
    assert.match(await values.textContent(), /row 15, column 90: range 4\.0000 m, .*label 5/);
    // Behind there is nothing.
    for (let i = 0; i < 9; i++) await page.keyboard.press("Shift+ArrowLeft");
    assert.match(await values.textContent(), /row 15, column 0: no return: nothing/);
    assert.ok(await page.locator(".marker").isVisible());
});

test("names are text, whatever they say", async (t) => {
    const { page } = await open(t, pages.walls);
    await choose(page, "instance");
    const legend = await page.locator(".legend").textContent();
    assert.ok(legend.includes(HOSTILE) && legend.includes("קיר צפוני \\u{202e}<b>"), legend);
    assert.deepEqual(await page.evaluate(() => [document.images.length, document.title, document.scripts.length]), [0, "walls.toml", 2]);
});

test("the page's policy lets nothing else run", async (t) => {
    const context = await withGl.newContext();
    t.after(() => context.close());
    const page = await context.newPage();
    await page.goto(pathToFileURL(pages.walls).href);
    const ran = await page.evaluate(async () => {
        const script = document.createElement("script");
        script.textContent = "window.taken = true";
        document.body.append(script);
        document.body.insertAdjacentHTML("beforeend", "<img src=x onerror='window.taken = true'><p id=styled style='color: red'>");
        const fetched = await fetch("walls.toml").then(() => true, () => false);
        return [window.taken, document.getElementById("styled").style.color, fetched];
    });
    assert.deepEqual(ran, [undefined, "", false]);
});

test("a check shows verdict, pictures of baseline, run and difference, and tables", async (t) => {
    const { page } = await open(t, pages.check);
    assert.match(await page.locator("main").textContent(), /The job failed/);
    const text = await page.locator("main").innerText();
    for (const part of ["walls.toml", "position_m", "0.0", "0.2", "not met", "99 % of the rays", "<b>many</b>"]) assert.ok(text.includes(part), part + " in " + text);
    for (const name of ["baseline", "run", "difference"]) {
        const picture = await drawn(page, `canvas[data-picture=${name}]`);
        assert.ok(picture.lit > 3000 && picture.colours > 10, name + JSON.stringify(picture));
    }
    const before = await drawn(page, CLOUD);
    await page.getByLabel("cloud coloured by difference").check();
    await settle(page);
    assert.notEqual((await drawn(page, CLOUD)).sum, before.sum);
    // The baseline keeps no pixels of normals.
    await choose(page, "normal");
    assert.equal(await page.locator(".picture.missing").count(), 2);
    await choose(page, "range");
    assert.equal(await page.locator(".picture.missing").count(), 0);
    const canvas = page.locator("canvas[data-picture=difference]");
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width * 180.5 / 360, box.y + box.height * 15.5 / 31);
    const values = await page.locator("output.values").innerText();
    assert.match(values, /run: range 9\.8000 m/);
    assert.match(values, /difference: -0\.20/);
    assert.equal(await page.locator(".marker:visible").count(), 3);
    // A sentence leads to its channel and pixel.
    await choose(page, "label");
    await page.locator(".sentences a[data-channel=range]").first().click();
    await page.waitForFunction(() => document.querySelector(".controls select").value === "range");
    assert.match(await page.locator("output.values").innerText(), /difference: /);
    assert.match(await page.locator(".legend .ramp .numbers").first().innerText(), /\d/);
});

test("without WebGL2 there are pictures and a sentence", async (t) => {
    const { page } = await open(t, pages.walls, { browser: withoutGl });
    assert.equal(await page.evaluate(() => document.createElement("canvas").getContext("webgl2")), null);
    assert.ok((await drawn(page, PICTURE)).lit > 3000);
    assert.ok(await page.getByText("shows no WebGL2").isVisible());
    assert.ok(!(await page.locator(CLOUD).isVisible()));
    await choose(page, "label");
    assert.ok((await drawn(page, PICTURE)).lit > 3000);
});

test("a frame of 128 × 2048 is small and opens fast", async (t) => {
    assert.ok(statSync(pages.street).size < 6e6, `${statSync(pages.street).size} bytes`);
    const { page, seconds } = await open(t, pages.street);
    assert.ok((await drawn(page, PICTURE)).lit > 150_000);
    // About one second on two idle cores that render in software.
    assert.ok(seconds < 15, `${seconds} s`);
    t.diagnostic(`${statSync(pages.street).size} bytes, shown after ${seconds} s`);
});

test("of a frame that is too large there are fewer pixels, with their own rows and columns", async (t) => {
    const { page } = await open(t, pages.large);
    assert.match(await page.locator("main").innerText(), /300 × 15000 pixels are too many for a page\. It shows one of 2 rows and one of 2 columns\./);
    assert.equal((await drawn(page, PICTURE)).pixels, 150 * 7500);
    const canvas = page.locator(PICTURE);
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width * 3750.5 / 7500, box.y + box.height * 75.5 / 150);
    // Row 150 of 300 is level but for a twentieth of a degree, column 7500 of 15000 looks straight ahead.
    assert.match(await page.locator("output.values").textContent(), /row 150, column 7500: range 10\.000\d m/);
});

test("a sequence plays, stops and goes to any frame, and everything on the page goes with it", async (t) => {
    const { page } = await open(t, pages.sequence);
    await page.waitForFunction(() => document.querySelector("section.rig").getAttribute("aria-busy") === "false");
    const RIG = "section.rig canvas.cloud", OWN = "section.view canvas.cloud";
    const where = page.locator(".where"), slider = page.locator(".moment");
    const sums = async () => {
        await settle(page);
        return [await drawn(page, RIG), await drawn(page, OWN)].map(({ sum, lit }) => (assert.ok(lit > 300, `${lit} pixels`), sum));
    };
    assert.match(await where.innerText(), /^frame 0 \(1 of 12\), 0\.000 s, body at \(0\.00, 0\.00, 0\.00\) m, yaw 0\.0°, 1 box$/);
    const first = await sums();
    await shoot(page, "sequence-0");
    await slider.focus();
    for (let i = 0; i < 7; i++) await page.keyboard.press("ArrowRight");
    assert.match(await where.innerText(), /^frame 7 \(8 of 12\), 0\.700 s, body at \(7\.00, /);
    await page.waitForTimeout(300);
    const eighth = await sums();
    first.forEach((sum, n) => assert.notEqual(sum, eighth[n], "cloud " + n));
    // Keys step from anywhere on the page, and the same frame looks the same again.
    await page.locator("h1").click();
    for (let i = 0; i < 7; i++) await page.keyboard.press(",");
    assert.match(await where.innerText(), /^frame 0 /);
    await page.waitForTimeout(300);
    assert.deepEqual(await sums(), first);
    await page.keyboard.press(",");
    assert.match(await where.innerText(), /^frame 0 /, "there is nothing before the first");
    // Playback goes on until it is stopped.
    await page.locator(".speed").selectOption("4");
    await page.locator("h1").click();
    await page.keyboard.press("Space");
    assert.equal(await page.getByRole("button", { name: "Pause" }).count(), 1);
    await page.waitForFunction(() => /^frame [3-9]/.test(document.querySelector(".where").textContent));
    await page.getByRole("button", { name: "Pause" }).click();
    await page.waitForTimeout(400);
    const stopped = await where.innerText();
    await page.waitForTimeout(400);
    assert.equal(await where.innerText(), stopped);
    // Who stands in the world sees the body go on, and who stands on the vehicle goes with it. Without boxes there is less to see.
    // Playback begins again after the last frame, so it may have stopped at any.
    const stepTo = async (frame) => {
        await slider.focus();
        await page.keyboard.press("Home");
        for (let i = 0; i < frame; i++) await page.keyboard.press("ArrowRight");
        assert.match(await where.innerText(), new RegExp(`^frame ${frame} `));
        await page.waitForTimeout(300);
        await settle(page);
        return drawn(page, RIG);
    };
    const onVehicle = await stepTo(8);
    await stepTo(7);
    await page.locator("section.rig").getByLabel("Stand on the").selectOption("world");
    await page.waitForTimeout(300);
    const world = await stepTo(8);
    assert.ok(world.lit > 300, JSON.stringify(world));
    assert.notEqual(world.sum, onVehicle.sum);
    await shoot(page, "sequence-world");
    await page.locator("section.rig").getByLabel("boxes").uncheck();
    await settle(page);
    assert.notEqual((await drawn(page, RIG)).sum, world.sum);
});

test("both themes can be read, by the system's wish or the page's switch", async (t) => {
    for (const [system, chosen, dark] of [["light", "", false], ["dark", "", true], ["light", "dark", true], ["dark", "light", false]]) {
        for (const name of chosen ? ["check"] : ["check", "camera"]) {
            const { page } = await open(t, pages[name], { colorScheme: system });
            if (chosen) await page.getByLabel("Theme").selectOption(chosen);
            const found = await page.evaluate(() => {
                const parse = (text) => text.match(/[\d.]+/g).slice(0, 3).map(Number);
                const light = (rgb) => rgb.map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
                    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
                const paper = light(parse(getComputedStyle(document.body).backgroundColor));
                const worst = { contrast: Infinity };
                for (const element of document.querySelectorAll("h1, h2, h3, p, small, label, a, th, td, td span, li, caption, figcaption, .legend")) {
                    const ink = light(parse(getComputedStyle(element).color));
                    const contrast = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
                    if (contrast < worst.contrast) Object.assign(worst, { contrast, element: element.outerHTML.slice(0, 80) });
                }
                return { dark: paper < 0.2, worst };
            });
            assert.equal(found.dark, dark, `${system} ${chosen}`);
            // WCAG 2.2, 1.4.3 (AA).
            assert.ok(found.worst.contrast >= 4.5, JSON.stringify(found.worst));
            if (!chosen) await shoot(page, `${name}-${system}`);
        }
    }
});

test("the keyboard comes by everything, in the order of the page", async (t) => {
    const { page } = await open(t, pages.check);
    const order = [];
    for (let i = 0; i < 24; i++) {
        await page.keyboard.press("Tab");
        order.push(await page.evaluate(() => {
            const { id, type, className, dataset, tagName } = document.activeElement;
            return id || dataset.picture || (type === "checkbox" ? type : className) || tagName.toLowerCase();
        }));
    }
    const expected = ["theme", "scroll", "scroll", "scroll", "select-one", "checkbox", "baseline", "run", "difference", "cloud"];
    const named = order.map((name) => (name === "select" ? "select-one" : name));
    assert.deepEqual(named.filter((name) => name !== "body" && name !== "a").slice(0, expected.length), expected);
    const unnamed = await page.evaluate(() => [...document.querySelectorAll("canvas[tabindex], select, input")]
        .filter((e) => !(e.ariaLabel || e.labels?.length)).map((e) => e.outerHTML));
    assert.deepEqual(unnamed, []);
});
