"""nuScenes' detection task: boxes matched by the distance of their centres, true-positive errors, NDS."""
