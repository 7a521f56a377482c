$fn = 64; // Sides of a round face: more are nearer to it, and slower.

module along(at, way) {
  translate(at) rotate([0, acos(way[2]/norm(way)), atan2(way[1], way[0])]) children();
}
// Points p with n . p + d >= 0, up to far away.
module half_space(n, d) {
  along(-d/(n*n)*n, n) translate([-far, -far, 0]) cube([2*far, 2*far, far]);
}
module block(low, high) { translate(low) cube(high - low); }
module rod(at, way, radius) { along(at, way) cylinder(h = 2*far, r = radius, center = true); }
module ball(at, radius) { translate(at) sphere(r = radius); }
module ring(at, way, circle, tube) {
  along(at, way) rotate_extrude() translate([circle, 0]) circle(r = tube);
}
module cones(at, way, slope) {
  along(at, way) cylinder(h = far, r1 = 0, r2 = slope*far);
  along(at, -way) cylinder(h = far, r1 = 0, r2 = slope*far);
}
