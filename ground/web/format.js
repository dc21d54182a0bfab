// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Values, times and spans as text. No state, no elements.

/** A value of a packet as text. null: the spacecraft does not know it. */
export function value_text(value) {
  if (value === null || value === undefined) return "unknown";
  if (typeof value !== "number" || Number.isInteger(value)) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e7)) return value.toExponential(3);
  return value.toFixed(size < 1 ? 4 : size < 100 ? 3 : size < 10000 ? 2 : 1);
}

/** "2026-11-26T20:57:42.444Z" as "20:57:42", with the date in front when it is another day than @p now. */
export function time_text(iso, now = Date.now()) {
  const time = iso ? new Date(iso) : null;
  if (!time || Number.isNaN(time.getTime())) return "unknown";
  const text = time.toISOString();
  return text.slice(0, 10) === new Date(now).toISOString().slice(0, 10) ? text.slice(11, 19) : `${text.slice(0, 10)} ${text.slice(11, 19)}`;
}

/** "850 ms", "12 s", "3 min 20 s", "2 h 5 min", "3 d 4 h" */
export function span_text(ms) {
  const sign = ms < 0 ? "-" : "";
  const s = Math.abs(ms) / 1000;
  if (s < 1) return `${sign}${Math.round(s * 1000)} ms`;
  if (s < 100) return `${sign}${Math.floor(s)} s`;
  if (s < 3600) return `${sign}${Math.floor(s / 60)} min${s < 600 && s % 60 >= 1 ? ` ${Math.floor(s % 60)} s` : ""}`;
  if (s < 86400) return `${sign}${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
  return `${sign}${Math.floor(s / 86400)} d ${Math.floor((s % 86400) / 3600)} h`;
}

export function octets_text(octets) {
  if (octets === null || octets === undefined) return "size unknown";
  if (octets < 10000) return `${octets} octets`;
  return octets < 1e6 ? `${(octets / 1024).toFixed(1)} KiB` : `${(octets / 1048576).toFixed(1)} MiB`;
}

/** "10m", "2h", "3d", "now-like" texts or ISO times as milliseconds since 1970; null: neither. */
export function parse_time(text, now = Date.now()) {
  const match = /^\s*([+-]?)(\d+(?:\.\d+)?)\s*(s|m|min|h|d)\s*$/.exec(text);
  if (match) {
    const ms = Number(match[2]) * { s: 1000, m: 60000, min: 60000, h: 3600000, d: 86400000 }[match[3]];
    return match[1] === "+" ? now + ms : now - ms;
  }
  const iso = text.trim().replace(" ", "T");
  const time = Date.parse(/[zZ]$|[+-]\d\d:\d\d$/.test(iso) ? iso : `${iso}Z`);
  return Number.isNaN(time) ? null : time;
}

/** Bounds as text: "7 … 8.3", "≥ 30", "≤ 0"; empty: none. */
export function bounds_text(low, high) {
  const has = (bound) => bound !== null && bound !== undefined;
  if (has(low) && has(high)) return `${low} … ${high}`;
  if (has(low)) return `≥ ${low}`;
  return has(high) ? `≤ ${high}` : "";
}

/** "payload_eps.battery_voltage_v" with places where a long name may break. */
export function breakable(name) {
  return name.replace(/([._])/g, "$1\u200b");
}

/** A version of the beacon, 4 bits major, 6 minor, 6 patch. */
export function version_text(number) {
  if (typeof number !== "number") return "unknown";
  return `${number >> 12}.${(number >> 6) & 63}.${number & 63}`;
}

/** Of @p items those with every word of @p words in their text; best ones first: words at the beginning of a name. */
export function search(items, words, text_of) {
  const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
  const score = (text) =>
    wanted.reduce((sum, word) => {
      const at = text.indexOf(word);
      if (at < 0 || sum === Infinity) return Infinity;
      return sum + (at === 0 ? 0 : /[._\s]/.test(text[at - 1]) ? 1 : 3);
    }, 0);
  return items
    .map((item) => [score(text_of(item).toLowerCase()), item])
    .filter(([n]) => n !== Infinity)
    .sort((a, b) => a[0] - b[0])
    .map(([, item]) => item);
}
