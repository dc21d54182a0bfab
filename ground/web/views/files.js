// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Files: uplink with progress, transfers, what came down, and the pictures of imaging tasks with their findings.

import { dialog, h, set_text, shape, toast } from "../dom.js";
import { octets_text, time_text, value_text } from "../format.js";
import { download } from "../parts/panels.js";

export const title = "Files";
const rows_max = 300;
const picture_name = /\.(png|jpe?g|fits|strips)$/i;

export function show(main, context) {
  const { model, signal } = context;
  const transfers = h("div.transfers");
  const gallery = h("div.gallery");
  const body = h("tbody");
  main.append(
    uplink_panel(context),
    h("section.panel", { "aria-label": "Transfers" }, h("h2", {}, "Transfers"), transfers),
    h("section.panel", { "aria-label": "Pictures" }, h("h2", {}, "Pictures"), gallery),
    h(
      "section.panel",
      { "aria-label": "Received" },
      h("h2", {}, "Received"),
      h(
        "table.compact.wide",
        {},
        h("thead", {}, h("tr", {}, ...["Name", "Size", "Time (UTC)", "Type", ""].map((text) => h("th", { scope: "col" }, text)))),
        body,
      ),
    ),
  );
  const update_transfers = () => show_transfers(context, transfers);
  const tasks = new Map();
  const load = async () => {
    const files = await context.api.get("files").catch((error) => {
      toast(error.message, "failed");
      return null;
    });
    if (!files || signal.aborted) return;
    files.sort((a, b) => (a.time < b.time ? 1 : a.time > b.time ? -1 : a.name < b.name ? -1 : 1));
    show_files(context, body, files);
    show_gallery(context, gallery, files, tasks);
  };
  let ended = 0;
  model.on(
    "files",
    () => {
      update_transfers();
      const now = [...model.files.values()].filter((one) => one.ended && one.direction === "down").length;
      if (now !== ended) {
        ended = now;
        clearTimeout(context.reload);
        context.reload = setTimeout(load, 250);
      }
    },
    signal,
  );
  update_transfers();
  load();
}

// --- up ---

function uplink_panel(context) {
  const { model } = context;
  const input = h("input", { type: "file", multiple: true, "aria-label": "Files to send up", disabled: !model.may_command() });
  const send = async (files) => {
    for (const file of files) {
      try {
        await context.api.request(`uplink?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
        toast(`${file.name} goes up`);
        if (file.name.endsWith(".pkg")) context.package = file.name;
      } catch (error) {
        toast(`${file.name}: ${error.message}`, "failed");
      }
    }
    input.value = "";
    if (context.package) install.hidden = false;
  };
  input.addEventListener("change", () => send([...input.files]));
  const install = h(
    "button",
    { hidden: true, onclick: () => context.command("package.install", { file: context.package, activate: "true" }) },
    "Install the package …",
  );
  const zone = h(
    "section.panel.drop",
    {
      "aria-label": "Uplink",
      ondragover: (event) => {
        event.preventDefault();
        zone.classList.add("over");
      },
      ondragleave: () => zone.classList.remove("over"),
      ondrop: (event) => {
        event.preventDefault();
        zone.classList.remove("over");
        if (model.may_command()) send([...event.dataTransfer.files]);
      },
    },
    h("h2", {}, "Send up"),
    h(
      "div.body",
      {},
      input,
      h(
        "span.hint",
        {},
        "Or drop files here. They arrive in the folder of files on board (CFDP). A package of sources (.pkg) is installed by package.install when it is there.",
      ),
      install,
    ),
  );
  return zone;
}

function show_transfers(context, element) {
  const { model, api } = context;
  const newest = [...model.files.values()].sort((a, b) => b.changed - a.changed);
  const transfers = [...newest.filter((one) => !one.ended).slice(0, 12), ...newest.filter((one) => one.ended).slice(0, 4)];
  const order = (id, word) => async () => {
    try {
      await api.post(`transfers/${encodeURIComponent(id)}`, { order: word });
    } catch (error) {
      toast(error.message, "failed");
    }
  };
  element.replaceChildren(
    ...transfers.map((one) => {
      const part = one.ended && one.success !== false ? 1 : one.octets ? (one.progress ?? 0) / one.octets : 0;
      const failed = one.success === false;
      const bar = h("progress", { max: 1, "aria-label": `${one.name}: ${Math.round(part * 100)} %` });
      bar.value = part;
      const buttons =
        one.ended || !model.may_command()
          ? []
          : [
              one.state === "suspended"
                ? h("button.quiet", { onclick: order(one.id, "resume") }, "Resume")
                : h("button.quiet", { onclick: order(one.id, "suspend") }, "Suspend"),
              h("button.quiet", { onclick: order(one.id, "cancel") }, "Cancel"),
            ];
      return h(
        "div.transfer",
        { dataset: { name: one.name ?? "", ended: String(Boolean(one.ended)) } },
        shape(failed ? "failed" : one.ended ? "done" : "wait"),
        h("span.direction", {}, one.direction === "up" ? "↑ up" : "↓ down"),
        h("span.name", {}, one.name ?? one.id),
        bar,
        h("span", {}, `${Math.round(part * 100)} % of ${octets_text(one.octets)}`),
        h("span.hint", {}, failed ? (one.condition ?? "failed") : one.ended ? "done" : (one.state ?? one.event ?? "")),
        ...buttons,
      );
    }),
  );
  if (!transfers.length) element.replaceChildren(h("p.hint", {}, "No transfer is known."));
}

// --- down ---

function show_files(context, body, files) {
  body.replaceChildren(
    ...files.slice(0, rows_max).map((file) =>
      h(
        "tr",
        {},
        h("th", { scope: "row" }, file.name),
        h("td.number", {}, octets_text(file.octets)),
        h("td", {}, time_text(file.time, context.model.now())),
        h("td", {}, file.type ?? ""),
        h(
          "td",
          {},
          h(
            "button.quiet",
            {
              onclick: async () => {
                try {
                  download(file.name, await context.api.file(file.name));
                } catch (error) {
                  toast(error.message, "failed");
                }
              },
            },
            "Save",
          ),
        ),
      ),
    ),
  );
  if (files.length > rows_max)
    body.append(h("tr", {}, h("td.hint", { colspan: 5 }, `The newest ${rows_max} of ${files.length} files; all are in STATE/files.`)));
  if (!files.length) body.replaceChildren(h("tr", {}, h("td", { colspan: 5 }, "Nothing was received yet.")));
}

/** "image_RANK_rRUN_TASK_NAME" (icd_ground_link.md, 4.8) in parts; null: another file. */
export function product_of(name) {
  const match = /^image_(\d{3})_(?:r([0-9a-f]{8})_)?(\d{10})_(?:([2-9])_)?(.+)$/.exec(name);
  return match ? { rank: Number(match[1]), run: match[2] ?? "", task: Number(match[3]), name: match[5] } : null;
}

function show_gallery(context, element, files, known) {
  const tasks = new Map();
  for (const file of files) {
    const product = product_of(file.name);
    if (!product) continue;
    const key = `task ${product.task}${product.run ? `, run ${product.run}` : ""}`;
    if (!tasks.has(key)) tasks.set(key, { title: key, files: [], time: file.time });
    tasks.get(key).files.push({ ...file, product });
  }
  const others = files.filter((file) => picture_name.test(file.name) && !product_of(file.name));
  if (others.length)
    tasks.set("other", {
      title: "Other pictures",
      files: others.map((file) => ({ ...file, product: { name: file.name, rank: 999 } })),
      time: others[0].time,
    });
  const shown = [...tasks.values()].slice(0, 12).map((task) => {
    const state = task.files
      .map((file) => file.name)
      .sort()
      .join();
    const before = known.get(task.title);
    if (before?.state === state) return before.element;
    const made = { state, element: task_card(context, task) };
    known.set(task.title, made);
    return made.element;
  });
  element.replaceChildren(...(shown.length ? shown : [h("p.hint", {}, "No picture yet. image.capture orders one.")]));
}

function task_card(context, task) {
  task.files.sort((a, b) => a.product.rank - b.product.rank);
  const overview = task.files.find((file) => file.product.name === "thumbnail.png");
  const findings_file = task.files.find((file) => file.product.name === "findings.json");
  const cut_outs = task.files.filter((file) => picture_name.test(file.name) && file !== overview);
  const words = h("p.words");
  const element = h(
    "article.task",
    { "aria-label": task.title },
    h("h3", {}, task.title, h("time", {}, time_text(task.time, context.model.now()))),
    words,
  );
  const findings = findings_file ? read_findings(context, findings_file.name) : Promise.resolve(null);
  findings.then((found) => set_text(words, found ? findings_words(found) : ""));
  if (overview) element.append(picture(context, overview.name, findings, "whole"));
  element.append(
    h("div.cut-outs", {}, ...cut_outs.slice(0, 24).map((file) => picture(context, file.name, findings, "part", file.product.name))),
  );
  return element;
}

async function read_findings(context, name) {
  try {
    const response = await context.api.request(`files/${encodeURIComponent(name)}?view=json`, { raw: true });
    return await response.json();
  } catch {
    return null;
  }
}

function findings_words(found) {
  const notes = (found.frames ?? []).flatMap((frame) => frame.notes ?? []);
  const solved = found.solution
    ? `attitude: right ascension ${value_text(found.solution.ra_deg)}, declination ${value_text(found.solution.dec_deg)} deg`
    : "attitude not found";
  return [
    `${found.method}: ${found.streaks?.length ?? 0} streaks, ${found.tracklets?.length ?? 0} tracklets in ${found.frame_count ?? found.frames?.length ?? 0} frames`,
    solved,
    ...notes.slice(0, 2),
  ].join(". ");
}

/** A picture on a canvas; over that of the whole frame the findings of its first frame are drawn. A click shows it large. */
function picture(context, name, findings, kind, caption = "") {
  const canvas = h("canvas", { width: 8, height: 8, role: "img", "aria-label": `Picture ${name}` });
  const words = h("figcaption", {}, caption);
  const element = h(
    `figure.${kind}`,
    { dataset: { file: name, state: "loading" } },
    h("button.quiet", { title: name, onclick: () => enlarge(context, name, findings, kind) }, canvas),
    words,
  );
  draw_picture(context, canvas, name, findings, kind, 1).then(
    (drawn) => {
      element.dataset.state = "shown";
      element.dataset.findings = String(drawn);
    },
    (error) => {
      element.dataset.state = "failed";
      set_text(words, `${name}: ${error.message}`);
    },
  );
  const number = /^(streak|tracklet)_(\d+)/.exec(caption);
  if (number)
    findings.then((found) => {
      const one = found?.[`${number[1]}s`]?.[Number(number[2])];
      if (one) set_text(words, `${number[1]} ${Number(number[2])}${one.snr ? `, SNR ${one.snr.toFixed(1)}` : ""}`);
    });
  return element;
}

async function draw_picture(context, canvas, name, findings, kind, scale) {
  const bitmap = await createImageBitmap(await context.api.file(name, name.endsWith(".png") ? null : "png"));
  canvas.width = bitmap.width * scale;
  canvas.height = bitmap.height * scale;
  const ctx = canvas.getContext("2d");
  ctx.imageSmoothingEnabled = kind === "whole";
  ctx.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  const found = kind === "whole" ? await findings : null;
  return found ? draw_findings(ctx, found, canvas) : 0;
}

/** Streaks as lines between brackets, numbered; tracklets as chains of circles. @return how many were drawn */
function draw_findings(ctx, found, canvas) {
  const frame = found.frames?.[0];
  if (!frame?.width) return 0;
  const scale = canvas.width / frame.width;
  const colour = getComputedStyle(canvas).getPropertyValue("--finding").trim() || "#ffb000";
  Object.assign(ctx, {
    strokeStyle: colour,
    fillStyle: colour,
    lineWidth: Math.max(1, canvas.width / 400),
    font: `${Math.max(9, canvas.width / 40)}px sans-serif`,
  });
  let drawn = 0;
  (found.streaks ?? []).forEach((streak, i) => {
    if (streak.frame !== 0) return;
    const [x1, y1, x2, y2] = [streak.x1, streak.y1, streak.x2, streak.y2].map((v) => v * scale);
    const margin = canvas.width / 60;
    ctx.strokeRect(Math.min(x1, x2) - margin, Math.min(y1, y2) - margin, Math.abs(x2 - x1) + 2 * margin, Math.abs(y2 - y1) + 2 * margin);
    ctx.fillText(String(i), Math.max(x1, x2) + margin + 2, Math.min(y1, y2));
    drawn += 1;
  });
  for (const tracklet of found.tracklets ?? []) {
    const points = (tracklet.points ?? []).filter((p) => typeof p.x === "number");
    for (const p of points) {
      ctx.beginPath();
      ctx.arc(p.x * scale, p.y * scale, canvas.width / 80, 0, 2 * Math.PI);
      ctx.stroke();
    }
    drawn += points.length ? 1 : 0;
  }
  return drawn;
}

async function enlarge(context, name, findings, kind) {
  const canvas = h("canvas.large", { role: "img", "aria-label": `Picture ${name}` });
  const box = dialog(name, canvas);
  box.classList.add("picture");
  try {
    const width = kind === "whole" ? 320 : 80; // of most products; a larger picture is shown as it is
    await draw_picture(context, canvas, name, findings, kind, Math.max(1, Math.floor((innerWidth * 0.85) / width / 2)));
  } catch (error) {
    box.append(h("p.problem", {}, error.message));
  }
}
