// Pictures and clouds of the page's frames. Nothing is fetched: each section holds its data, deflated, and is unpacked when it
// comes near the window.
"use strict";
(() => {
    const NOTHING = [0x10, 0x10, 0x14]; // the colour of no return
    const SAME = [0x4a, 0x4a, 0x52], LESS = [0x4c, 0x9b, 0xff], MORE = [0xff, 0x8c, 0x2e];
    const GONE = [0x2f, 0xe0, 0xd8], NEW = [0xff, 0x4f, 0xd0];

    const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const turbo = bytesOf(document.body.dataset.turbo);

    function element(name, text, attributes = {}) {
        const made = document.createElement(name);
        made.textContent = text;
        for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
        return made;
    }

    // ---- Unpacking ----

    async function unpack({ kind, count, neighbour, data }) {
        const stream = new Blob([bytesOf(data)]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
        const planes = new Uint8Array(await new Response(stream).arrayBuffer());
        const bits = { f32: new Uint32Array(count), u32: new Uint32Array(count), u16: new Uint16Array(count), i8: new Uint8Array(count) }[kind];
        for (let byte = 0; byte < bits.BYTES_PER_ELEMENT; byte++) {
            for (let i = 0, from = byte * count; i < count; i++) bits[i] |= planes[from + i] << (8 * byte);
        }
        for (let i = neighbour; i < count; i++) bits[i] += bits[i - neighbour];
        return kind === "f32" ? new Float32Array(bits.buffer) : kind === "i8" ? new Int8Array(bits.buffer) : bits;
    }

    async function unpackChannels(channels) {
        for (const channel of channels ?? []) channel.values = await Promise.all(channel.packed.map(unpack));
        return channels;
    }

    // ---- Values and colours ----

    const depthOf = (channels) => channels.find((c) => c.is_depth)?.values[0];
    const isSeen = (depth, i) => depth === undefined || Number.isFinite(depth[i]);
    // Numbers that stand for words are known of every pixel, also of one without a return.
    const isKnown = (channel, depth, i) => channel.words || isSeen(depth, i);
    const wordOf = (channel, value) => channel.words[value].replaceAll("_", " ");

    function quantile(values, seen, part) {
        const step = Math.max(1, Math.floor(values.length / 50000));
        const sample = [];
        for (let i = 0; i < values.length; i += step) if (seen(i) && Number.isFinite(values[i])) sample.push(values[i]);
        sample.sort((a, b) => a - b);
        return sample.length ? sample[Math.floor((sample.length - 1) * part)] : 0;
    }

    // The part of a range's colours that is left out at either end, so that an outlier does not flatten the rest.
    function scaleOf(channel, depth) {
        const values = channel.values[0], seen = (i) => isSeen(depth, i);
        const positive = channel.scale === "log";
        let low = quantile(values, seen, positive ? 0.01 : 0), high = quantile(values, seen, positive ? 0.99 : 1);
        if (channel.key === "intensity") [low, high] = [0, high / (values instanceof Uint16Array ? 65535 : 1)];
        if (positive) low = Math.max(low, 1e-3);
        return { low, high: Math.max(high, low) };
    }

    function idColour(id) {
        // Steps of the golden angle keep neighbouring ids apart; lightness tells ids of alike hue apart.
        const hue = (id * 137.508) % 360, light = 0.45 + 0.1 * ((id * 7) % 4);
        const part = (n) => {
            const k = (n + hue / 30) % 12;
            return Math.round(255 * (light - 0.75 * Math.min(light, 1 - light) * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
        };
        return [part(0), part(8), part(4)];
    }

    const valueOf = (channel, i) => channel.key === "intensity" && channel.values[0] instanceof Uint16Array ? channel.values[0][i] / 65535 : channel.values[0][i];

    function colourer(channel, scale) {
        if (channel.scale === "id") {
            const known = new Map();
            return (i) => {
                const id = channel.values[0][i];
                if (!known.has(id)) known.set(id, idColour(id));
                return known.get(id);
            };
        }
        if (channel.scale === "normal") return (i) => channel.values.map((axis) => 128 + axis[i]);
        const { low, high } = scale;
        const at = channel.scale === "log" ? (v) => Math.log(v / low) / Math.log(high / low) : (v) => (v - low) / (high - low);
        return (i) => {
            const t = high > low ? at(valueOf(channel, i)) : 0.5;
            const index = 3 * Math.round(255 * Math.min(1, Math.max(0, Number.isNaN(t) ? 0 : t)));
            return [turbo[index], turbo[index + 1], turbo[index + 2]];
        };
    }

    function decimals(unit) { return unit === "m" ? 4 : 6; }

    function shown(channel, i, view) {
        if (channel.scale === "normal") return "(" + channel.values.map((axis) => (axis[i] / 127).toFixed(2)).join(", ") + ")";
        const value = valueOf(channel, i);
        if (channel.scale === "id") {
            if (channel.words?.[value]) return wordOf(channel, value);
            const name = channel.key === "id.instance" ? view.instances[value] : undefined;
            return name === undefined ? String(value) : value + " “\u2068" + name + "\u2069”";
        }
        return Number(value).toFixed(decimals(channel.unit)) + (channel.unit ? " " + channel.unit : "");
    }

    // How a pixel of the run differs from the baseline's: [colour, words].
    function differ(view, key) {
        view.differences ??= new Map();
        if (!view.differences.has(key)) view.differences.set(key, findDifference(view, key));
        return view.differences.get(key);
    }

    function findDifference(view, key) {
        const run = view.channels.find((c) => c.key === key), before = view.baseline.find((c) => c.key === key);
        if (!run || !before) return undefined;
        const [was, is] = [depthOf(view.baseline), depthOf(view.channels)];
        const exact = run.scale === "id", normal = run.scale === "normal";
        const tolerance = before.resolution / 2;
        const delta = (i) => normal
            ? Math.hypot(...run.values.map((axis, k) => (axis[i] - before.values[k][i]) / 127))
            : valueOf(run, i) - valueOf(before, i);
        const count = run.values[0].length;
        let largest = 0;
        for (let i = 0; i < count; i++) {
            if (isSeen(was, i) && isSeen(is, i)) {
                const d = Math.abs(delta(i));
                if (d > tolerance && d < Infinity) largest = Math.max(largest, d);
            }
        }
        const mix = (to, t) => SAME.map((c, k) => Math.round(c + (to[k] - c) * t));
        const of = (i) => {
            const [a, b] = [isKnown(before, was, i), isKnown(run, is, i)];
            if (!a && !b) return [NOTHING, "no return in either"];
            if (!a) return [NEW, "appeared"];
            if (!b) return [GONE, "vanished"];
            const d = delta(i);
            if (exact) return d === 0 ? [SAME, "the same"] : [MORE, "another"];
            if (Math.abs(d) <= tolerance) return [SAME, "the same"];
            // The square root lets small differences be seen beside large ones.
            const t = 0.25 + 0.75 * Math.sqrt(Math.min(1, Math.abs(d) / largest));
            return [mix(d < 0 ? LESS : MORE, t), (d > 0 ? "+" : "") + d.toFixed(decimals(run.unit)) + (run.unit ? " " + run.unit : "")];
        };
        return { of, largest, exact, normal, unit: run.unit };
    }

    // ---- WebGL: one context for all clouds, whose picture each cloud copies ----

    const VERTEX = `#version 300 es
        uniform mat4 view; uniform vec3 low, size; uniform float point;
        in vec3 grid; in vec4 colour; out vec4 shade;
        void main() {
            gl_Position = view * vec4(low + size * grid, 1.0);
            gl_PointSize = clamp(point / gl_Position.w, 1.0, 6.0) * 1.5;
            shade = colour;
        }`;
    const FRAGMENT = `#version 300 es
        precision mediump float;
        in vec4 shade; out vec4 pixel;
        void main() { pixel = shade; }`;

    const painter = (() => {
        let shared;
        const make = () => {
            const canvas = document.createElement("canvas");
            const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
            if (!gl) return null;
            let program;
            const start = () => {
                program = gl.createProgram();
                for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
                    const shader = gl.createShader(kind);
                    gl.shaderSource(shader, source);
                    gl.compileShader(shader);
                    gl.attachShader(program, shader);
                }
                gl.bindAttribLocation(program, 0, "grid");
                gl.bindAttribLocation(program, 1, "colour");
                gl.linkProgram(program);
            };
            start();
            const clouds = [];
            canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
            canvas.addEventListener("webglcontextrestored", () => {
                start();
                for (const cloud of clouds) cloud.restored();
            });
            const attribute = (index, buffer, size, kind) => {
                gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
                gl.enableVertexAttribArray(index);
                gl.vertexAttribPointer(index, size, kind, true, 0, 0);
            };
            const buffer = (data) => {
                const made = gl.createBuffer();
                gl.bindBuffer(gl.ARRAY_BUFFER, made);
                gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
                return made;
            };
            const paint = (width, height, view, point, batches) => {
                if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
                gl.viewport(0, 0, width, height);
                gl.clearColor(NOTHING[0] / 255, NOTHING[1] / 255, NOTHING[2] / 255, 1);
                gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
                gl.enable(gl.DEPTH_TEST);
                gl.useProgram(program);
                const uniform = (name) => gl.getUniformLocation(program, name);
                gl.uniformMatrix4fv(uniform("view"), false, view);
                gl.uniform1f(uniform("point"), point);
                for (const { low, size, grid, kind, colour, count, lines } of batches) {
                    gl.uniform3fv(uniform("low"), low);
                    gl.uniform3fv(uniform("size"), size);
                    attribute(0, grid, 3, kind);
                    attribute(1, colour, 4, gl.UNSIGNED_BYTE);
                    gl.drawArrays(lines ? gl.LINES : gl.POINTS, 0, count);
                }
            };
            return { gl, canvas, buffer, paint, clouds };
        };
        return () => (shared === undefined ? (shared = make()) : shared);
    })();

    // Column by column, as WebGL has them.
    function times(a, b) {
        const product = new Float32Array(16);
        for (let column = 0; column < 4; column++) {
            for (let row = 0; row < 4; row++) {
                for (let k = 0; k < 4; k++) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
            }
        }
        return product;
    }

    // A cloud on its canvas: an eye that goes around a target, z up.
    function cloudOf(canvas, view, axes) {
        const tool = painter();
        if (!tool) return null;
        const { gl } = tool;
        const context = canvas.getContext("2d");
        const count = axes[0].values.length;
        const low = axes.map((axis) => axis.low), size = axes.map((axis) => axis.step * 65535);
        const grid = new Uint16Array(3 * count);
        for (let i = 0; i < count; i++) for (let k = 0; k < 3; k++) grid[3 * i + k] = axes[k].values[i];
        const at = (i, k) => low[k] + axes[k].step * axes[k].values[i];
        // The eye starts behind and a little to the left, twice as far away as three quarters of the points.
        const middle = [0, 1, 2].map((k) => quantile(axes[k].values, () => true, 0.5) * axes[k].step + low[k]);
        const distances = [];
        for (let i = 0; i < count; i += Math.max(1, Math.floor(count / 20000))) {
            distances.push(Math.hypot(at(i, 0) - middle[0], at(i, 1) - middle[1], at(i, 2) - middle[2]));
        }
        distances.sort((a, b) => a - b);
        const radius = Math.max(distances[Math.floor(0.75 * distances.length)] ?? 1, 0.1);
        const start = () => ({ yaw: 0.92 * Math.PI, pitch: 0.5, distance: 2 * radius, target: [...middle] });
        let eye = start(), waiting = false, colours = new Uint8Array(4 * count), buffers;

        const upload = () => {
            const cross = new Float32Array([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]);
            const paints = [[255, 80, 80, 255], [90, 230, 110, 255], [110, 160, 255, 255]].flatMap((c) => [...c, ...c]);
            buffers = {
                grid: tool.buffer(grid), colour: tool.buffer(colours),
                cross: tool.buffer(cross), paints: tool.buffer(new Uint8Array(paints)),
            };
        };
        upload();

        const draw = () => {
            waiting = false;
            const scale = window.devicePixelRatio || 1;
            const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
            if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
            const { yaw, pitch, distance, target } = eye;
            const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
            const back = [cp * cy, cp * sy, sp], right = [-sy, cy, 0], up = [-sp * cy, -sp * sy, cp];
            const from = target.map((t, k) => t + distance * back[k]);
            const dot = (a) => -(a[0] * from[0] + a[1] * from[1] + a[2] * from[2]);
            const look = [
                right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, dot(right), dot(up), dot(back), 1,
            ];
            const near = distance / 200, far = distance * 200, f = 1.6;
            const lens = [f * Math.min(1, height / width), 0, 0, 0, 0, f * Math.min(1, width / height), 0, 0, 0, 0, -(far + near) / (far - near), -1, 0, 0, -2 * far * near / (far - near), 0];
            tool.paint(width, height, times(lens, look), 2 * scale * radius * Math.min(2.5, Math.max(0.6, Math.sqrt(60000 / count))), [
                { low, size, grid: buffers.grid, kind: gl.UNSIGNED_SHORT, colour: buffers.colour, count },
                { low: [0, 0, 0], size: [1, 1, 1], grid: buffers.cross, kind: gl.FLOAT, colour: buffers.paints, count: 6, lines: true },
            ]);
            context.drawImage(tool.canvas, 0, 0);
        };
        const redraw = () => {
            if (!waiting) requestAnimationFrame(draw);
            waiting = true;
        };
        const turn = (dx, dy) => {
            eye.yaw -= dx * 0.008;
            eye.pitch = Math.min(1.57, Math.max(-1.57, eye.pitch + dy * 0.008));
            redraw();
        };
        const zoom = (factor) => {
            eye.distance = Math.min(1e3 * radius, Math.max(1e-3 * radius, eye.distance * factor));
            redraw();
        };
        const move = (dx, dy) => {
            const step = 1.3 * eye.distance / Math.max(1, Math.max(canvas.clientHeight, canvas.clientWidth));
            const [sy, cy, sp, cp] = [Math.sin(eye.yaw), Math.cos(eye.yaw), Math.sin(eye.pitch), Math.cos(eye.pitch)];
            const right = [-sy, cy, 0], up = [-sp * cy, -sp * sy, cp];
            eye.target = eye.target.map((t, k) => t - step * dx * right[k] + step * dy * up[k]);
            redraw();
        };

        const fingers = new Map();
        canvas.addEventListener("pointerdown", (event) => {
            canvas.setPointerCapture(event.pointerId);
            fingers.set(event.pointerId, [event.clientX, event.clientY]);
        });
        canvas.addEventListener("pointermove", (event) => {
            const before = fingers.get(event.pointerId);
            if (!before) return;
            const now = [event.clientX, event.clientY];
            const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
            const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
            if (other) {
                const apart = (p) => Math.max(1, Math.hypot(p[0] - other[0], p[1] - other[1]));
                zoom(apart(before) / apart(now));
                move(dx / 2, dy / 2);
            } else if (event.shiftKey || event.buttons & 2) {
                move(dx, dy);
            } else {
                turn(dx, dy);
            }
            fingers.set(event.pointerId, now);
        });
        for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
        canvas.addEventListener("contextmenu", (event) => event.preventDefault());
        canvas.addEventListener("wheel", (event) => {
            event.preventDefault();
            zoom(Math.exp(Math.sign(event.deltaY) * Math.min(0.2, Math.abs(event.deltaY) * 0.002)));
        }, { passive: false });
        canvas.addEventListener("keydown", (event) => {
            const arrows = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] };
            if (event.ctrlKey || event.altKey || event.metaKey) return;
            if (event.key in arrows) (event.shiftKey ? move : turn)(...arrows[event.key]);
            else if (event.key === "+" || event.key === "=") zoom(0.8);
            else if (event.key === "-") zoom(1.25);
            else if (event.key === "0" || event.key === "Home") { eye = start(); redraw(); }
            else return;
            event.preventDefault();
        });
        new ResizeObserver(redraw).observe(canvas);
        tool.clouds.push({ restored: () => { upload(); redraw(); } });

        // `pixels` are the pixels with a return, in order: the points.
        return (colour, pixels) => {
            for (let i = 0; i < count; i++) {
                const [r, g, b] = colour(pixels[i] ?? 0);
                colours.set([r, g, b, 255], 4 * i);
            }
            gl.deleteBuffer(buffers.colour);
            buffers.colour = tool.buffer(colours);
            redraw();
        };
    }

    // ---- A frame's section ----

    async function show(section) {
        const view = JSON.parse(section.querySelector("script").textContent);
        await unpackChannels(view.channels);
        await unpackChannels(view.baseline);
        const { rows, columns } = view;
        const depth = depthOf(view.channels);
        const controls = section.querySelector(".controls"), legend = section.querySelector(".legend");

        const choice = element("select", "");
        for (const channel of view.channels) choice.append(element("option", channel.label, { value: channel.key }));
        const label = element("label", "Show ");
        label.append(choice);
        controls.append(label);
        let differences;
        if (view.baseline && view.points) {
            differences = element("input", "", { type: "checkbox" });
            const label = element("label", "");
            label.append(differences, " cloud coloured by difference");
            controls.append(label);
        }

        // Every picture, with what colours its pixels.
        const pictures = [...section.querySelectorAll("canvas[data-picture]")];
        for (const canvas of pictures) {
            [canvas.width, canvas.height] = [columns, rows];
            canvas.style.aspectRatio = columns + " / " + rows * view.stretch;
        }
        const channelsOf = (picture) => (picture === "baseline" ? view.baseline : view.channels);
        const fill = (canvas, seen, colour) => {
            const context = canvas.getContext("2d");
            const image = context.createImageData(columns, rows);
            for (let i = 0; i < rows * columns; i++) {
                const [r, g, b] = seen(i) ? colour(i) : NOTHING;
                image.data.set([r, g, b, 255], 4 * i);
            }
            context.putImageData(image, 0, 0);
        };

        let paintCloud = null, pixels = [];
        const cloud = section.querySelector("canvas.cloud");
        if (cloud) {
            for (const axis of view.points) axis.values = await unpack(axis.packed);
            paintCloud = cloudOf(cloud, view, view.points);
            if (paintCloud) {
                for (let i = 0; i < rows * columns; i++) if (isSeen(depth, i)) pixels.push(i);
            } else {
                cloud.hidden = true;
                section.querySelector(".cloud-hint").hidden = true;
                section.querySelector(".no-webgl").hidden = false;
            }
        }

        const swatch = (colour, text) => {
            const span = element("span", "");
            const box = element("i", "", { class: "swatch" });
            box.style.background = "rgb(" + colour.join(",") + ")";
            span.append(box, element("bdi", text));
            return span;
        };

        const tell = (channel, scale) => {
            legend.replaceChildren();
            if (channel.scale === "normal") {
                legend.append("red, green and blue: the normal's x, y and z, from −1 (dark) to 1 (bright)");
            } else if (channel.scale === "id") {
                const counts = new Map();
                for (let i = 0; i < rows * columns; i++) if (isKnown(channel, depth, i)) counts.set(channel.values[0][i], (counts.get(channel.values[0][i]) ?? 0) + 1);
                const most = [...counts].sort((a, b) => b[1] - a[1] || a[0] - b[0]);
                for (const [id, count] of most.slice(0, 12)) {
                    const name = channel.key === "id.instance" ? view.instances[id] : undefined;
                    if (channel.words?.[id]) legend.append(swatch(idColour(id), wordOf(channel, id) + ": " + count));
                    else legend.append(swatch(idColour(id), id + (name === undefined ? "" : " “\u2068" + name + "\u2069”") + ": " + count));
                }
                if (most.length > 12) legend.append(most.length - 12 + " more");
            } else {
                const bar = element("canvas", "", { width: 256, height: 1, role: "img", "aria-label": "colour scale" });
                const image = bar.getContext("2d").createImageData(256, 1);
                for (let i = 0; i < 256; i++) image.data.set([turbo[3 * i], turbo[3 * i + 1], turbo[3 * i + 2], 255], 4 * i);
                bar.getContext("2d").putImageData(image, 0, 0);
                const number = (v) => Number(v.toPrecision(4)) + (channel.unit ? " " + channel.unit : "");
                legend.append(number(scale.low), bar, number(scale.high) + (channel.scale === "log" ? " (logarithmic)" : ""));
            }
            if (depth && pictures.length && !channel.words) legend.append(swatch(NOTHING, "no return"));
            const difference = view.baseline && differ(view, channel.key);
            if (difference) {
                legend.append("Difference:", swatch(SAME, "the same"));
                const to = difference.largest ? " (up to " + Number(difference.largest.toPrecision(3)) + (difference.unit ? " " + difference.unit : "") + ")" : "";
                if (difference.exact) legend.append(swatch(MORE, "another"));
                else if (difference.normal) legend.append(swatch(MORE, "turned"));
                else legend.append(swatch(LESS, "less" + to), swatch(MORE, "more" + to));
                legend.append(swatch(NEW, "appeared"), swatch(GONE, "vanished"));
            }
        };

        const paint = () => {
            const key = choice.value;
            const channel = view.channels.find((c) => c.key === key);
            const scale = scaleOf(channel, depth);
            const difference = view.baseline && differ(view, key);
            for (const canvas of pictures) {
                const picture = canvas.dataset.picture;
                if (picture === "difference") {
                    fill(canvas, () => difference, (i) => difference.of(i)[0]);
                } else {
                    const channels = channelsOf(picture);
                    const own = channels.find((c) => c.key === key), seen = depthOf(channels);
                    if (own) fill(canvas, (i) => isKnown(own, seen, i), colourer(own, scale));
                    else fill(canvas, () => false);
                }
            }
            if (paintCloud) {
                const byDifference = differences?.checked && difference;
                paintCloud(byDifference ? (i) => difference.of(i)[0] : colourer(channel, scale), pixels);
            }
            tell(channel, scale);
        };

        const output = section.querySelector(".values");
        let place = null;
        const inspect = (row, column) => {
            place = [row, column];
            const i = row * columns + column;
            output.replaceChildren();
            for (const canvas of pictures) {
                const picture = canvas.dataset.picture;
                const line = element("p", "");
                if (picture === "difference") {
                    const difference = differ(view, choice.value);
                    line.append("difference: ", difference ? difference.of(i)[1] : "the baseline has no pixels of this channel");
                } else {
                    const channels = channelsOf(picture), seen = depthOf(channels);
                    line.append(pictures.length > 1 ? picture + ": " : "row " + row + ", column " + column + ": ");
                    const cause = channels.find((c) => c.key === "cause");
                    if (!isSeen(seen, i)) line.append("no return", cause ? ": " + shown(cause, i, view) : "");
                    else channels.forEach((c, n) => line.append(n ? ", " : "", element("b", c.label + " "), shown(c, i, view)));
                }
                output.append(line);
                const marker = canvas.parentElement.querySelector(".marker");
                marker.hidden = false;
                marker.style.left = 100 * (column + 0.5) / columns + "%";
                marker.style.top = 100 * (row + 0.5) / rows + "%";
            }
            if (pictures.length > 1) output.prepend(element("p", "row " + row + ", column " + column));
        };
        for (const canvas of pictures) {
            canvas.addEventListener("pointermove", (event) => {
                const box = canvas.getBoundingClientRect();
                const part = (at, from, size, n) => Math.min(n - 1, Math.max(0, Math.floor(n * (at - from) / size)));
                inspect(part(event.clientY, box.top, box.height, rows), part(event.clientX, box.left, box.width, columns));
            });
            canvas.addEventListener("keydown", (event) => {
                const by = event.shiftKey ? 10 : 1;
                const step = { ArrowLeft: [0, -by], ArrowRight: [0, by], ArrowUp: [-by, 0], ArrowDown: [by, 0] }[event.key];
                if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
                event.preventDefault();
                const [row, column] = place ?? [Math.floor(rows / 2), Math.floor(columns / 2)];
                const within = (v, n) => Math.min(n - 1, Math.max(0, v));
                inspect(within(row + step[0], rows), within(column + step[1], columns));
            });
        }
        choice.addEventListener("change", () => {
            paint();
            if (place) inspect(...place);
        });
        differences?.addEventListener("change", paint);
        paint();
        section.setAttribute("aria-busy", "false");
    }

    // ---- The page ----

    document.getElementById("theme").addEventListener("change", (event) => {
        document.documentElement.dataset.theme = event.target.value;
    });
    const fail = (section, why) => {
        section.setAttribute("aria-busy", "false");
        section.append(element("p", "This frame can't be shown: " + why, { role: "alert" }));
    };
    const sight = new IntersectionObserver((entries) => {
        for (const { isIntersecting, target } of entries) {
            if (!isIntersecting) continue;
            sight.unobserve(target);
            if (typeof DecompressionStream === "undefined") fail(target, "this browser can't unpack its data; those of 2023 and later can.");
            else show(target).catch((error) => fail(target, error.message));
        }
    }, { rootMargin: "300px" });
    for (const section of document.querySelectorAll("section.view")) sight.observe(section);
})();
