within WheelsetRig.Forces;
model Bushing "Spring and damper in six directions, with preload"
  extends Interfaces.PartialForce;
  parameter Units.Stiffness c[3] = zeros(3) "Stiffness along x, y, z";
  parameter Units.Damping d[3] = zeros(3) "Damping along x, y, z";
  parameter Units.RotationalStiffness cRot[3] = zeros(3) "Stiffness about x, y, z";
  parameter Units.RotationalDamping dRot[3] = zeros(3) "Damping about x, y, z";
  parameter Units.Force f0[3] = zeros(3) "Force on the body at frame_b at rest";
  parameter Units.Torque t0[3] = zeros(3) "Torque on the body at frame_b at rest";
  Units.Length e[3] "Displacement";
  Units.Velocity de[3] "Its rate";
  Units.Angle theta[3] "Rotation";
  Units.AngularVelocity dtheta[3] "Its rate";
equation
  e = frame_b.r_0 - frame_a.r_0;
  de = der(e);
  theta = frame_b.phi - frame_a.phi;
  dtheta = der(theta);
  frame_b.f = c.*e + d.*de - f0;
  frame_b.t = cRot.*theta + dRot.*dtheta - t0;
  energy = 0.5*(c.*e)*e + 0.5*(cRot.*theta)*theta - f0*e - t0*theta;
  lossPower = (d.*de)*de + (dRot.*dtheta)*dtheta;
end Bushing;
