// The rule that fires most in each fuzzy system, by its number: 1 is the first rule of metadata `fis.<name>`.
import { Input } from "./types";

export const inputs = ["/fis/force_x", "/fis/force_y", "/fis/force_z"];
export const output = "/studio_script/rules";

type Event = Input<"/fis/force_x"> | Input<"/fis/force_y"> | Input<"/fis/force_z">;
type Rules = { force_x: number; force_y: number; force_z: number };

/** The number of the strongest rule, 0 where none fires. */
function strongest(strengths: ArrayLike<number>): number {
  let rule = 0;
  let most = 0;
  for (let i = 0; i < strengths.length; i++) {
    const strength = strengths[i] ?? 0;
    if (strength > most) {
      rule = i + 1;
      most = strength;
    }
  }
  return rule;
}

const latest: Rules = { force_x: 0, force_y: 0, force_z: 0 };

export default function script(event: Event): Rules {
  const rule = strongest(event.message.firing_strengths);
  switch (event.topic) {
    case "/fis/force_x":
      latest.force_x = rule;
      break;
    case "/fis/force_y":
      latest.force_y = rule;
      break;
    case "/fis/force_z":
      latest.force_z = rule;
      break;
  }
  return { force_x: latest.force_x, force_y: latest.force_y, force_z: latest.force_z };
}
