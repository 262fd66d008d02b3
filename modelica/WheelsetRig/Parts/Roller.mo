within WheelsetRig.Parts;
model Roller "Roller in fixed bearings"
  parameter Units.Inertia J(min=1.0) "Moment of inertia about its axle";
  Interfaces.Flange flange annotation (Placement(transformation(extent={{90,-10},{110,10}})));
  Units.Angle phi(start=0.0, fixed=true) "Angle";
  Units.AngularVelocity omega "Angular velocity; its start value is set where it is used";
  Units.Energy energy "Kinetic energy";
equation
  flange.phi = phi;
  der(phi) = omega;
  J*der(omega) = flange.tau;
  energy = 0.5*J*omega^2;
end Roller;
