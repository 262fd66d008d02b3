  package Old
    model Pump "the old pump"
      output Real x(start=0, fixed=true);
    equation
      der(x) = -x;
      annotation(experiment(StopTime=1, Tolerance=1e-2));
    end Pump;
  end Old;
  package New
    model Pump "the new pump"
      output Real x(start=0, fixed=true);
    equation
      der(x) = -100*x;
      annotation(experiment(StartTime=50, StopTime=500, Tolerance=1e-9));
    end Pump;
    model Plain
      output Real x(start=0, fixed=true);
    equation
      der(x) = -x;
    end Plain;
  end New;
