within WheelsetRig.Tests;
model AdhesionRecoversWithSlipEnergy "Sliding cleans the contact, in either direction"
  Effects.AdhesionRecovery forward(level=0.15, w=5.0, v=30.0, Fx=10000.0, gain=0.8);
  Effects.AdhesionRecovery reverse(level=0.15, w=-5.0, v=-30.0, Fx=-10000.0, gain=0.8);
  Effects.AdhesionRecovery rolling(level=0.15, w=0.0, v=30.0, Fx=10000.0, gain=0.8);
  Units.FrictionCoefficient expected = 0.15*(1.0 + 0.8*(1.0 - exp(-5.0*10000.0*time/250e3)));
equation
  // 1e-7: ten times the solver's tolerance.
  assert(abs(forward.mu0 - expected) < 1e-7, "Friction after energy of slip");
  assert(abs(reverse.mu0 - expected) < 1e-7, "Friction after energy of slip, in reverse");
  assert(abs(rolling.mu0 - 0.15) < 1e-7, "Rolling cleans");
  annotation (experiment(StopTime=10.0, Tolerance=1e-8));
end AdhesionRecoversWithSlipEnergy;
