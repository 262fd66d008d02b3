within LeakingChamber.Effects;
model LaminarLeak "pores or gaps that air leaves by, in proportion to the pressure"
  extends Common.Leaks.Laminar(conductance(max=1e-7));
  annotation (
    __Workbench(effect(
      size="conductance", matters=3e-14,
      separation="the flow at several pressures that are kept")),
    Documentation(info="<html>
<p>1e-10 kg/(s.Pa) empty a tenth of a litre with a time constant of 12 s. Printed walls leak between
their layers.</p>
</html>"));
end LaminarLeak;
