within WheelsetRig.Parts;
model Body "Rigid body with its centre of gravity in frame_a"
  parameter Units.Mass m "Mass";
  parameter Units.Inertia I[3] "Principal moments of inertia about x, y, z";
  outer World world;
  Interfaces.Frame frame_a annotation (Placement(transformation(extent={{-110,-10},{-90,10}})));
  Units.Velocity v[3] "Velocity of the centre of gravity";
  Units.AngularVelocity w[3] "Angular velocity";
  Units.Energy energy "Kinetic energy and energy of position";
equation
  v = der(frame_a.r_0);
  w = der(frame_a.phi);
  m*der(v) = frame_a.f + {0.0, 0.0, -m*world.g};
  I.*der(w) = frame_a.t;
  energy = 0.5*m*(v*v) + 0.5*(I.*w)*w + m*world.g*frame_a.r_0[3];
end Body;
