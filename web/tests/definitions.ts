// SPDX-License-Identifier: Apache-2.0
import { ros2humble } from "@foxglove/rosmsg-msgs-common";

/** ROS 2's definition of a type, `std_msgs/msg/String`, and of all that it is made of. */
export function definitions(type: string): any[] {
  const found = new Map<string, any>();
  const add = (name: string) => {
    const definition = (ros2humble as Record<string, any>)[name];
    if (!definition || found.has(name)) return;
    found.set(name, { ...definition, name: found.size === 0 ? undefined : name });
    for (const field of definition.definitions) if (field.isComplex) add(field.type);
  };
  add(type.replace("/msg/", "/"));
  if (found.size === 0) throw new Error(`ROS 2 has no ${type}`);
  return [...found.values()];
}
