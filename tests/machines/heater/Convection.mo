  model Convection "air that rises from the block"
    extends PartialLoss;
    parameter Real c(unit="W/K", min=0.0, max=5.0) = 0.0 "Conductance at 10 K";
  equation
    Q = c*T*sqrt(abs(T)/10.0 + 1e-6);
    annotation (__Workbench(effect(
      size="c", matters=0.02, separation="the block on its side")));
  end Convection;

