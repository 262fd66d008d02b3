within TrainRig.Tests;
model EffectsActInTheirPlace "An effect changes the axle, bogie or vehicle that its size names, no other"
  Effects.WeakPads pads(u=fill(0.3, 8), T=fill(350.0, 8), power=zeros(8), loss={0, 0, 0.2, 0, 0, 0, 0, 0});
  Effects.AllPads every(u=fill(0.3, 8), T=fill(350.0, 8), power=zeros(8), loss=0.1);
  Effects.Glazing glazing(
    u=fill(0.3, 8), T={383.15, 320.0, 450.0, 320.0, 320.0, 320.0, 320.0, 320.0},
    power=zeros(8), loss=0.2);
  Effects.WaterFilm water(
    u=fill(0.3, 8), T=fill(350.0, 8), film=1.0, E0=0.45e6,
    power={0.0, 1.35e6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  Effects.IsolatedUnit unit(u=fill(3.0, 8), lost={0, 0, 0, 0, 0, 1.0, 0, 0});
  Effects.DraggingBrake drag(omega=fill(50.0, 8), torque={0, 0, 0, 0, 0, 0, 0, 900.0});
  Effects.CylinderLag lag(u=fill(2e5, 4), restBefore=zeros(4), heldBefore=fill(2e5, 4), lag={0, 0.5, 0, 0});
  Effects.PressureSensorGain gauge(u=fill(2.2e5, 4), restBefore=zeros(4), heldBefore=fill(2e5, 4), gain={0, 0, 0.1, 0});
  Effects.PressureSensorOffset zero(u=fill(2e5, 4), restBefore=fill(100.0, 4), heldBefore=fill(2e5, 4), offset={0, 2e3, 0, 0});
  Effects.WheelRadius radius(u=fill(0.46, 8), deviation={0, -0.002, 0, 0, 0, 0, 0, 0});
  Effects.PoleCount poles(u=fill(50.0, 8), gain={0.01, 0, 0, 0, 0, 0, 0, 0});
  Effects.LateSpeed late(u=fill(50.0 - 2.0*time, 8), lag={0, 0, 0, 0.05, 0, 0, 0, 0});
  Effects.WrongMass mass(u={44e3, 50e3}, gain={0, 0.1});
  Effects.WrongGradient gradient(u=2e-3, offset=1e-3);
  Effects.LowAdhesion rail(u=0.4, gain=-0.5);
  Effects.AirResistance air(u=5.5, gain=0.2);
  Effects.AccelerometerBias tilted(u=-1.0, offset=0.05);
  Effects.AccelerometerGain scaled(u=-1.0, gain=0.02);
equation
  assert(abs(pads.y[3] - 0.24) < 1e-12 and abs(sum(pads.y) - 2.34) < 1e-12, "Pads of axle 3");
  assert(abs(sum(every.y) - 8.0*0.27) < 1e-12, "Pads of all axles");
  assert(abs(glazing.y[1] - 0.27) < 1e-12 and abs(glazing.y[3] - 0.24) < 1e-5
    and abs(glazing.y[2] - 0.3) < 1e-5, "Half is lost at 110 degrees, all far above, none below");
  assert(abs(water.y[1] - 0.12) < 1e-12 and abs(water.y[2] - (0.3 - 0.18*exp(-time))) < 1e-6,
    "A film of three discs leaves with 0.45 MJ of each, and where nothing rubs it stays");
  assert(abs(unit.y[6] - 2.0) < 1e-12 and abs(sum(unit.y) - 23.0) < 1e-12, "Unit of axle 6");
  assert(abs(drag.tau[8] - 900.0) < 1e-9 and abs(sum(drag.tau) - 900.0) < 1e-9, "Drag of axle 8");
  // A first-order lag with a smoothing of 10 ms beside it: 2 in 10 000 of the step at once.
  assert(abs(lag.y[2] - 2e5*(1.0 - exp(-time/0.5))) < 100.0 and abs(lag.y[1] - 2e5) < 1e-6,
    "Cylinders of bogie 2 do not lag");
  assert(abs(gauge.y[3] - 2e5) < 1e-6 and abs(gauge.y[1] - 2.2e5) < 1e-6, "Gauge of bogie 3");
  assert(abs(zero.y[2] - 1.98e5) < 1e-6 and abs(zero.y[1] - 2e5) < 1e-6, "Zero of bogie 2");
  assert(abs(zero.rest[2] - 2.1e3) < 1e-9 and abs(zero.rest[1] - 100.0) < 1e-9,
    "An empty cylinder reads the offset, beside what reads before");
  assert(abs(zero.held[2] - 2.02e5) < 1e-6 and abs(gauge.held[3] - 2.2e5) < 1e-6
      and abs(lag.held[2] - 2e5) < 1e-6,
    "A sensor is off by its offset or gain while the brake is applied; a lag is over by then");
  assert(abs(tilted.y + 0.95) < 1e-12 and abs(scaled.y + 1.02) < 1e-12, "Accelerometer");
  assert(abs(radius.y[2] - 0.458) < 1e-12 and abs(sum(radius.y) - 3.678) < 1e-12, "Wheel 2");
  assert(abs(poles.y[1] - 50.5) < 1e-12 and abs(sum(poles.y) - 400.5) < 1e-12, "Poles of axle 1");
  // The start is forgotten after 20 time constants; then it is late by the lag.
  assert(time < 1.0 or abs(late.y[4] - (50.0 - 2.0*(time - 0.05))) < 1e-6, "Not late by 50 ms");
  assert(abs(late.y[1] - (50.0 - 2.0*time)) < 1e-12, "Another sensor is late");
  assert(abs(mass.y[2] - 55e3) < 1e-9 and abs(mass.y[1] - 44e3) < 1e-9, "Mass of vehicle 2");
  assert(abs(gradient.y - 3e-3) < 1e-15 and abs(rail.y - 0.2) < 1e-15 and abs(air.y - 6.6) < 1e-12,
    "Gradient, rail, air");
  annotation (experiment(StopTime=2.0, Tolerance=1e-9));
end EffectsActInTheirPlace;
