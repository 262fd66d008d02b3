within WheelsetRig.Joints;
model Prismatic "Joint that slides along an axis"
  extends Interfaces.PartialTwoFrames;
  parameter Integer n[3] "Axis: one of x, y, z";
  Units.Length s(start=0.0, fixed=true) "Displacement";
  Units.Velocity v(start=0.0, fixed=true) "Velocity";
  Units.Acceleration a "Acceleration";
equation
  frame_b.r_0 = frame_a.r_0 + n*s;
  frame_b.phi = frame_a.phi;
  der(s) = v;
  a = der(v);
  frame_a.f + frame_b.f = zeros(3);
  frame_a.t + frame_b.t = zeros(3);
  n*frame_b.f = 0.0;
end Prismatic;
