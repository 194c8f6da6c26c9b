/** The page's colours have one home, its style sheet: light, dark and paper. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const names = ['paper', 'ink', 'soft', 'grid', 'axis', 'before', 'after', 'floor', 'x', 'y', 'z'];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Calls when they change: another scheme, or paper. */
export function onColours(changed) {
  for (const query of ['(prefers-color-scheme: dark)', 'print']) {
    matchMedia(query).addEventListener('change', changed);
  }
}
