within WheelsetRig.Joints;
model Revolute "Joint that turns about an axis by a small angle"
  extends Interfaces.PartialTwoFrames;
  parameter Integer n[3] "Axis: one of x, y, z";
  Units.Angle phi(start=0.0, fixed=true) "Angle";
  Units.AngularVelocity w(start=0.0, fixed=true) "Angular velocity";
  Units.AngularAcceleration a "Angular acceleration";
equation
  frame_b.r_0 = frame_a.r_0;
  frame_b.phi = frame_a.phi + n*phi;
  der(phi) = w;
  a = der(w);
  frame_a.f + frame_b.f = zeros(3);
  frame_a.t + frame_b.t = zeros(3);
  n*frame_b.t = 0.0;
end Revolute;
