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
                gl.uniform1f(uniform("point"), point);
                for (const { low, size, grid, kind, colour, count, mode, mount } of batches) {
                    gl.uniformMatrix4fv(uniform("view"), false, mount ? times(view, mount) : view);
                    gl.uniform3fv(uniform("low"), low);
                    gl.uniform3fv(uniform("size"), size);
                    attribute(0, grid, 3, kind);
                    attribute(1, colour, 4, gl.UNSIGNED_BYTE);
                    gl.drawArrays(mode ?? gl.POINTS, 0, count);
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

    // Clouds on a canvas: an eye that goes around a target, z up. Each part of `parts` has the axes of its points, and may have a
    // mount, a matrix into the frame that all share. `shapes` are lines and triangles in that frame or on a mount.
    function cloudOf(canvas, parts, shapes = []) {
        const tool = painter();
        if (!tool) return null;
        const { gl } = tool;
        const context = canvas.getContext("2d");
        const cloudFrom = ({ axes, mount }) => {
            const count = axes[0].values.length;
            const grid = new Uint16Array(3 * count);
            for (let i = 0; i < count; i++) for (let k = 0; k < 3; k++) grid[3 * i + k] = axes[k].values[i];
            const own = (i, k) => axes[k].low + axes[k].step * axes[k].values[i];
            const at = (i, k) => (mount ? mount[k] * own(i, 0) + mount[4 + k] * own(i, 1) + mount[8 + k] * own(i, 2) + mount[12 + k] : own(i, k));
            const [low, size] = [axes.map((axis) => axis.low), axes.map((axis) => axis.step * 65535)];
            return { count, grid, at, low, size, mount, colours: new Uint8Array(4 * count), hidden: false };
        };
        const clouds = parts.map(cloudFrom);
        const count = clouds.reduce((sum, cloud) => sum + cloud.count, 0);
        // The eye starts behind and a little to the left, twice as far away as three quarters of the points.
        const sample = [];
        for (const cloud of clouds) {
            const step = Math.max(1, Math.floor(count / 50000));
            for (let i = 0; i < cloud.count; i += step) sample.push([0, 1, 2].map((k) => cloud.at(i, k)));
        }
        const sorted = (values) => values.sort((a, b) => a - b);
        const middle = [0, 1, 2].map((k) => sorted(sample.map((p) => p[k]))[Math.floor((sample.length - 1) / 2)] ?? 0);
        const distances = sorted(sample.map((p) => Math.hypot(...p.map((x, k) => x - middle[k]))));
        const radius = Math.max(distances[Math.floor(0.75 * distances.length)] ?? 1, 0.1);
        let home = middle;
        const start = () => ({ yaw: 0.92 * Math.PI, pitch: 0.5, distance: 2 * radius, target: [...home] });
        let eye = start(), waiting = false, buffers;

        const upload = () => {
            const cross = new Float32Array([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1]);
            const paints = [[255, 80, 80, 255], [90, 230, 110, 255], [110, 160, 255, 255]].flatMap((c) => [...c, ...c]);
            buffers = {
                cross: tool.buffer(cross), paints: tool.buffer(new Uint8Array(paints)),
                clouds: clouds.map((cloud) => ({ grid: tool.buffer(cloud.grid), colour: tool.buffer(cloud.colours) })),
                shapes: shapes.map((shape) => ({ grid: tool.buffer(shape.points), colour: tool.buffer(shape.colours) })),
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
                ...clouds.map((cloud, n) => ({ ...cloud, ...buffers.clouds[n], kind: gl.UNSIGNED_SHORT })).filter((cloud) => !cloud.hidden),
                ...shapes.map((shape, n) => ({
                    low: [0, 0, 0], size: [1, 1, 1], kind: gl.FLOAT, ...buffers.shapes[n], count: shape.points.length / 3,
                    mode: shape.lines ? gl.LINES : gl.TRIANGLES, mount: shape.mount, hidden: shape.hidden,
                })).filter((shape) => !shape.hidden),
                { low: [0, 0, 0], size: [1, 1, 1], grid: buffers.cross, kind: gl.FLOAT, colour: buffers.paints, count: 6, mode: gl.LINES },
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

        return {
            // Colours the points of a part: `colour` gives that of the point of this number.
            paint(part, colour) {
                const cloud = clouds[part];
                for (let i = 0; i < cloud.count; i++) {
                    const [r, g, b] = colour(i, cloud.at);
                    cloud.colours.set([r, g, b, 255], 4 * i);
                }
                gl.deleteBuffer(buffers.clouds[part].colour);
                buffers.clouds[part].colour = tool.buffer(cloud.colours);
                redraw();
            },
            hide(part, hidden) {
                clouds[part].hidden = hidden;
                redraw();
            },
            // Puts the points of another frame in the place of a part's. They have no colour until they are painted.
            replace(part, points) {
                const { hidden } = clouds[part];
                clouds[part] = Object.assign(cloudFrom(points), { hidden });
                for (const old of Object.values(buffers.clouds[part])) gl.deleteBuffer(old);
                buffers.clouds[part] = { grid: tool.buffer(clouds[part].grid), colour: tool.buffer(clouds[part].colours) };
            },
            // Gives a shape other points.
            reshape(n, points, colours) {
                Object.assign(shapes[n], { points, colours });
                for (const old of Object.values(buffers.shapes[n])) gl.deleteBuffer(old);
                buffers.shapes[n] = { grid: tool.buffer(points), colour: tool.buffer(colours) };
            },
            // Looks at another middle, which is also the one to go back to.
            lookAt(target) {
                home = target;
                eye.target = [...target];
                redraw();
            },
            middle,
            redraw,
            // The height below which a part of all points is.
            height: (part) => sorted(sample.map((p) => p[2]))[Math.floor((sample.length - 1) * part)] ?? 0,
        };
    }

