within WheelsetRig.Tests;
model ChainedEffectsOfSizeZeroAreNominal "All effects at once, of size zero, are the nominal model"
  model PadFriction "Chain of all effects on pad friction"
    extends Brakes.PartialPadFriction;
    Effects.SpeedDependentPadFriction speed(level=level, Fperp=Fperp, v=v);
    Effects.PressureDependentPadFriction force(level=speed.mu, Fperp=Fperp, v=v);
    Effects.BeddingIn bedding(level=force.mu, Fperp=Fperp, v=v);
    Effects.DiscThicknessVariation thickness(level=bedding.mu, Fperp=Fperp, v=v);
    Effects.WaterFilm film(level=thickness.mu, Fperp=Fperp, v=v);
    Effects.SingleDiscWaterFilm single(level=film.mu, Fperp=Fperp, v=v);
    Effects.BrakeFade heat(level=single.mu, Fperp=Fperp, v=v);
  equation
    mu = heat.mu;
  end PadFriction;

  model Cylinder "Chain of all effects on pressure"
    extends Brakes.PartialCylinder;
    Effects.PressureSensorOffset sensor(pB=pB, restBefore=restBefore);
    Effects.CylinderLag late(pB=sensor.p, restBefore=sensor.rest);
    Effects.ReturnSpringPressure spring(pB=late.p, restBefore=late.rest);
    Effects.CaliperHysteresis caliper(pB=spring.p, restBefore=spring.rest);
  equation
    p = caliper.p;
    rest = caliper.rest;
  end Cylinder;

  model Adhesion "Chain of all effects on the friction of the contact"
    extends Contact.PartialAdhesion;
    Effects.AdhesionRecovery cleaned(level=level, w=w, v=v, Fx=Fx);
    Effects.FallingFriction falling(level=cleaned.mu0, w=w, v=v, Fx=Fx);
  equation
    mu0 = falling.mu0;
  end Adhesion;

  model WheelRadius "Chain of all effects on the wheel radius"
    extends Quantities.PartialWheelRadius;
    Effects.WheelRadius wear(u=u, omega=omega);
    Effects.OutOfRoundWheel shape(u=wear.y, omega=omega);
  equation
    y = shape.y;
  end WheelRadius;

  model SpeedSensor "Chain of all errors of a speed sensor"
    extends Sensors.PartialSpeedSensor;
    Sensors.PoleRingEccentricity ring(u=u);
    Sensors.SpeedSignalDelay late(u=ring.y);
  equation
    y = late.y;
  end SpeedSensor;

  model ForceSensor "Chain of all errors of the load cells"
    extends Sensors.PartialForceSensor;
    Effects.ApexOffset apex(u=u, Q=Q);
    Sensors.FxGain gain(u=apex.y, Q=Q);
    Sensors.FxOffset zero(u=gain.y, Q=Q);
  equation
    y = zero.y;
  end ForceSensor;

  model AllEffects "Observer model with all effects"
    extends MinimalObserver(
      redeclare PadFriction padFriction, redeclare Cylinder cylinder,
      redeclare WheelRadius wheelRadius, redeclare Effects.RollerRadius rollerRadius,
      redeclare Effects.WheelLoad wheelLoad,
      redeclare Effects.CreepStiffness creepStiffness,
      redeclare Effects.WheelInertia wheelInertia,
      redeclare Effects.RollerInertia rollerInertia, redeclare Effects.DriveTorqueGain driveTorque,
      redeclare Adhesion adhesion, redeclare Effects.WheelsetLosses wheelsetLoss,
      redeclare Effects.RollerLosses rollerLoss, redeclare SpeedSensor speedSensorW,
      redeclare ForceSensor forceSensor);
  end AllEffects;

  constant Real tolerance(unit="1") = 1e-10 "Of the solver, as in the experiment";
  final parameter Units.Force K = 2.0*Contact.kalkerStiffness(80000.0) "Creep force per creepage";
  final parameter Units.Force slack = 10.0*tolerance*K "What a solver leaves of two forces";
  Units.Pressure p = 1.35e5*(1.0 + tanh(4.0*(time - 0.5))) "Brake pressure";
  MinimalObserver nominal(
    pB=p, tauR=500.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  AllEffects zero(
    pB=p, tauR=500.0, dmuWR=0.0, dmuDC=0.0, correctionW=0.0, correctionR=0.0,
    omegaW(start=20.0*0.70/0.46), omegaR(start=20.0));
  output Units.Force dFx = zero.Fx - nominal.Fx "Change of the creep force";
equation
  // A speed that is off by the solver's tolerance is a creepage of that size; tenfold adds up.
  assert(abs(dFx) < slack, "The creep force changes");
  assert(abs(zero.FxReading - nominal.FxReading) < slack, "The reading of the force changes");
  assert(abs(zero.omegaWReading - nominal.omegaWReading) < 1e-6
    and abs(zero.omegaRReading - nominal.omegaRReading) < 1e-6, "A reading of a speed changes");
  assert(abs(zero.pBRest) < 1e-9, "An empty cylinder does not read zero");
  annotation (experiment(StopTime=1.0, Tolerance=1e-10));
end ChainedEffectsOfSizeZeroAreNominal;
