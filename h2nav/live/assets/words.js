// Numbers, ages and sizes in words.

export function fixed(value, digits) {
  if (value === null) return "–";
  const text = value.toFixed(digits);
  return text.replace("-", Number(text) === 0 ? "" : "−");
}

export function degrees(value, digits = 1) {
  return value === null ? "–" : `${fixed(value, digits)}°`;
}

export const signed = (value) => (value > 0 ? "+" : "") + degrees(value);

export function span(seconds) {
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export const ago = (seconds) => (seconds < 1 ? "now" : `${span(seconds)} ago`);

export function bytes(count) {
  if (count < 1e3) return `${count.toFixed(0)} B`;
  return count < 1e6 ? `${(count / 1e3).toFixed(1)} kB` : `${(count / 1e6).toFixed(1)} MB`;
}
