within TrainRig.Tests;
model OneVehicleStopsAsTwo "A train of one vehicle and one of two, all alike, slow down alike"
  model Alike "A train of vehicles of 50 t"
    extends Train;
    parameter Real pressure(unit="Pa") = 2.0e5 "In all cylinders";
  equation
    braking = sum(tauB[i]/rA[i] for i in 1:n)/weight;
    pC = fill(pressure, bogies);
    mu = ordinary;
    acting = fill(units, n);
    drag = zeros(n);
    rA = r;
    m = fill(50e3, vehicles);
    mu0 = muWR;
    rest = A;
    air = C*vehicles;
    uphill = 0.0;
    slope = zeros(vehicles);
    curves = 0.0;
    dmuDC = zeros(n);
    for i in 1:n loop
      der(omega[i]) = rate[i];
    end for;
    der(v) = acceleration;
  end Alike;
  Alike one(vehicles=1, A=1000.0, B=10.0,
    v(start=25.0, fixed=true), omega(each start=54.0, each fixed=true));
  Alike two(vehicles=2, A=2000.0, B=20.0,
    v(start=25.0, fixed=true), omega(each start=54.0, each fixed=true));
equation
  assert(abs(one.v - two.v) < 1e-5, "The number of vehicles matters");
  assert(time < 10.0 or one.v < 18.0, "The train does not slow down");
  annotation (experiment(StopTime=12.0, Tolerance=1e-8));
end OneVehicleStopsAsTwo;
