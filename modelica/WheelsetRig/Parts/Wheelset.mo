within WheelsetRig.Parts;
model Wheelset "Axle with wheels and brake discs: five motions of the axle, and spin"
  parameter Units.Mass m(min=1.0) "Mass";
  parameter Units.Inertia I(min=1.0) "Moment of inertia about x and z";
  parameter Units.Inertia J(min=1.0) "Moment of inertia about the axle";
  outer World world;
  Interfaces.Frame axle "Axle centre; does not spin"
    annotation (Placement(transformation(extent={{90,-10},{110,10}})));
  Interfaces.Flange spin "Rotation about the axle"
    annotation (Placement(transformation(extent={{-110,-10},{-90,10}})));
  Units.Length r[3](each start=0.0, each fixed=true) "xW, yW, zW";
  Units.Velocity v[3](each start=0.0, each fixed=true) "Velocity of the axle centre";
  Units.Angle alpha(start=0.0, fixed=true) "Roll";
  Units.Angle gamma(start=0.0, fixed=true) "Yaw";
  Units.AngularVelocity omegaX(start=0.0, fixed=true) "Roll velocity";
  Units.AngularVelocity omegaZ(start=0.0, fixed=true) "Yaw velocity";
  Units.Angle phi(start=0.0, fixed=true) "Angle of spin";
  Units.AngularVelocity omega "Angular velocity of spin; its start value is set where it is used";
  Units.Energy energy "Kinetic energy and energy of position";
equation
  axle.r_0 = r;
  axle.phi = {alpha, 0.0, gamma};
  spin.phi = phi;
  der(r) = v;
  der(alpha) = omegaX;
  der(gamma) = omegaZ;
  der(phi) = omega;
  m*der(v) = axle.f + {0.0, 0.0, -m*world.g};
  // The spinning mass couples roll and yaw; the axle's own pitch is spin.
  I*der(omegaX) - J*omega*omegaZ = axle.t[1];
  I*der(omegaZ) + J*omega*omegaX = axle.t[3];
  J*der(omega) = spin.tau;
  energy = 0.5*m*(v*v) + 0.5*I*(omegaX^2 + omegaZ^2) + 0.5*J*omega^2 + m*world.g*r[3];
  annotation (Documentation(info="<html>
<p>The joint chain of the wheelset with its mass behind the last joint: x, y, z, yaw, roll, spin.
Bushings, pads and contacts act on <code>axle</code>, in front of the spin joint, and on
<code>spin</code>. An element that acts at the rim therefore passes its force to
<code>axle</code> at the height of the axle, and its moment about the axle to <code>spin</code>.
Nothing acts on <code>axle</code> about y: the chain has no pitch in front of the spin joint.</p>
</html>"));
end Wheelset;
