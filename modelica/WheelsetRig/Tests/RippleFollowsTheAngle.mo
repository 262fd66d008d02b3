within WheelsetRig.Tests;
model RippleFollowsTheAngle "Order-locked effects repeat with the angle of the wheel"
  parameter Units.AngularVelocity omega = 50.0 "Angular velocity of the wheelset";
  Effects.DiscThicknessVariation disc(
    level=0.30, Fperp=30000.0, v=0.30*omega, cosine=0.02, sine=-0.01, order=2.0);
  Effects.OutOfRoundWheel wheel(u=0.46, omega=omega, cosine=2e-4, sine=1e-4, order=3.0);
  Sensors.PoleRingEccentricity ring(u=-omega, cosine=0.001, sine=0.002);
equation
  // An angle of 50 rad is known to ten times the solver's tolerance of it, 5e-6 rad; that times the
  // order and size of what turns is 0.7e-7, 0.3e-8 m and 0.6e-6 rad/s.
  assert(abs(disc.mu - 0.30*(1.0 + 0.02*cos(2.0*omega*time) - 0.01*sin(2.0*omega*time))) < 1e-7,
    "Disc thickness");
  assert(abs(wheel.y - 0.46 - 2e-4*cos(3.0*omega*time) - 1e-4*sin(3.0*omega*time)) < 1e-8,
    "Wheel radius");
  assert(abs(ring.y + omega*(1.0 + 0.001*cos(omega*time) - 0.002*sin(omega*time))) < 1e-6,
    "Pole ring, in reverse");
  annotation (experiment(StopTime=1.0, Tolerance=1e-8));
end RippleFollowsTheAngle;
