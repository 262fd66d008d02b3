within WheelsetRig.Joints;
model FreeMotion "No joint: six states of motion"
  extends Interfaces.PartialTwoFrames;
  Units.Length r[3](each start=0.0, each fixed=true) "Displacement";
  Units.Velocity v[3](each start=0.0, each fixed=true) "Velocity";
  Units.Angle phi[3](each start=0.0, each fixed=true) "Rotation";
  Units.AngularVelocity w[3](each start=0.0, each fixed=true) "Angular velocity";
  Units.Acceleration a[3] "Acceleration";
  Units.AngularAcceleration z[3] "Angular acceleration";
equation
  frame_b.r_0 = frame_a.r_0 + r;
  frame_b.phi = frame_a.phi + phi;
  der(r) = v;
  der(phi) = w;
  a = der(v);
  z = der(w);
  frame_a.f = zeros(3);
  frame_a.t = zeros(3);
  frame_b.f = zeros(3);
  frame_b.t = zeros(3);
end FreeMotion;
