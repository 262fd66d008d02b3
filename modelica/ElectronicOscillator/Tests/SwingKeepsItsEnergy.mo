within ElectronicOscillator.Tests;
model SwingKeepsItsEnergy "Undamped, a stiffening spring gives back what it took"
  Oscillator linear(u=0.0, db=0.0, d=0.0, y(start=0.2));
  Oscillator cubic(u=0.0, db=0.0, d=0.0, y(start=0.2), redeclare Effects.CubicSpring spring(k3=4.0));
equation
  assert(abs(2.5e-6*linear.v^2 + 0.5*linear.y^2 - 0.02) < 1e-6, "Energy of the linear one is lost");
  assert(abs(2.5e-6*cubic.v^2 + 0.5*cubic.y^2 + cubic.y^4 - 0.0216) < 1e-6, "Energy is lost");
  annotation (experiment(StopTime=0.1, Tolerance=1e-9));
end SwingKeepsItsEnergy;
