within TrainRig.Tests;
model DiscsKeepTheirHeat "Each disc has the heat of its own pads; one without pads cools alone"
  Parts.Axle axle(
    v=20.0, Q=60e3, mu0=0.4, p=2.25e5, unit={1.0, 1.0, 0.0}, omega(start=43.4));
  Real heat(unit="J", start=0.0, fixed=true, nominal=1e5) "Into disc 1, less what it gave off";
protected
  parameter Real cooling(unit="W/K") = 1.1*(25.0 + 8.0*((0.65*20.0)^2 + 1e-4)^0.4);
equation
  assert(abs(axle.T[3] - (293.15 + 30.0*exp(-cooling/37500.0*time))) < 1e-4, "It does not cool");
  assert(abs(axle.T[1] - axle.T[2]) < 1e-9 and (time < 1.0 or axle.T[1] > axle.T[3] + 1.0),
    "Discs with pads do not heat alike");
  // Of 1.3 kJ per kelvin and second; pads of two discs take what the rail gives, less losses.
  der(heat) = 0.93*0.5*axle.tauB*axle.omega - cooling*(axle.T[1] - 293.15);
  assert(abs(37500.0*(axle.T[1] - 323.15) - heat) < 10.0, "Heat is not kept");
  annotation (experiment(StopTime=20.0, Tolerance=1e-8));
end DiscsKeepTheirHeat;
