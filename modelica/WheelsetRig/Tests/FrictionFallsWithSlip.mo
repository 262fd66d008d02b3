within WheelsetRig.Tests;
model FrictionFallsWithSlip "Friction changes with slip, in either direction, and not while rolling"
  Effects.FallingFriction forward(level=0.2, w=6.0, v=30.0, Fx=10000.0, gain=-0.4, w0=2.0);
  Effects.FallingFriction reverse(level=0.2, w=-6.0, v=-30.0, Fx=-10000.0, gain=-0.4, w0=2.0);
  Effects.FallingFriction rolling(level=0.2, w=0.0, v=30.0, Fx=10000.0, gain=-0.4, w0=2.0);
  Effects.FallingFriction far(level=0.2, w=30.0, v=30.0, Fx=10000.0, gain=-0.4, w0=2.0);
equation
  // Rounding of numbers of order one.
  assert(abs(forward.mu0 - 0.2*(1.0 - 0.4*(1.0 - exp(-3.0)))) < 1e-12, "Friction in a slide");
  assert(abs(reverse.mu0 - forward.mu0) < 1e-12, "Friction in a slide, in reverse");
  assert(abs(rolling.mu0 - 0.2) < 1e-12, "Friction of a wheel that rolls changes");
  assert(abs(far.mu0 - 0.2*0.6) < 1e-6, "Friction far into a slide");
  annotation (experiment(StopTime=0.1, Tolerance=1e-8));
end FrictionFallsWithSlip;
