within TrainRig.Tests;
model GapIsCrossedFreely "Vehicles within the gap of a coupler are free; at its end they exchange speeds"
  Parts.Vehicle first(m=50e3, Fx=zeros(4), resistance=0.0, v(start=1.0));
  Parts.Vehicle second(m=50e3, Fx=zeros(4), resistance=0.0, v(start=0.8));
  Parts.Coupler coupler(c=1e7, d=0.0, gap=0.04);
protected
  // 20 mm at 0.2 m/s, then half a swing of 20 rad/s, then 40 mm back.
  parameter Real met(unit="s") = 0.1;
  parameter Real parted(unit="s") = met + 3.141592653589793/20.0;
  constant Real error(unit="s") = 1e-3 "By which a solver may miss the ends of the gap";
equation
  connect(first.rear, coupler.front);
  connect(coupler.rear, second.front);
  assert(time > met - error or abs(coupler.F) <= 0.0 and abs(first.v - 1.0) < 1e-6,
    "A force within the gap");
  assert(time < parted + error or time > parted + 0.2 - error
    or abs(first.v - 0.8) < 1e-4 and abs(second.v - 1.0) < 1e-4, "They do not exchange speeds");
  // c*s at the end of a swing: 0.2 m/s over 20 rad/s.
  assert(abs(time - 0.5*(met + parted)) > error or abs(coupler.F - 1e5) < 200.0,
    "Not the force of an elastic blow");
  annotation (experiment(StopTime=0.45, Tolerance=1e-8));
end GapIsCrossedFreely;
